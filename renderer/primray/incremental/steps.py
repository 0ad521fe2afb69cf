"""The steps of preparing a render with the results of earlier ones: a step is repeated only if its inputs have changed.

Inputs are compared by identity: an incremental translation returns unchanged parts as the same objects. Files count as
unchanged if their sizes and times are.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checkpoints.fingerprint import PARTS, fields_of, fingerprint_of
from ..description import SceneDescription, Surface, TextureFile, TextureInput, Wrap
from ..description.shading import pattern_files, without_images
from ..diagnostics import Diagnostic, Diagnostics
from ..process_memory import machine_bytes, resident_bytes
from ..render.prepare import Steps, Textures, image_sizes, read_files
from ..report.summary import ImageSize
from ..settings import DefaultWrap, Filter, RenderSettings, rows
from ..tessellation.dice import DicedBefore
from ..textures.texture import Texture
from ..textures.texture_set import LoadedFile, images_of, load_files, with_read_textures
from ..textures.tile_cache import TileCache, tile_cache

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..core.surface_upload import KeptImages
    from ..description import Light, Shape

    Limits = list[tuple[str, str, str]]
    Counts = tuple[dict[str, int], dict[str, Any] | None]


# Fields that decide how finely control cages are diced.
SHAPED = frozenset({"shapes", "static", "prototypes", "placements"})
LOOKED_AT = frozenset({"camera", "camera_motion", "exposure", "resolution", "pixels", "pixel_aspect_ratio"})
NOT_JUDGED = frozenset({"pixels", "aovs"})  # what the test render of a stage without lights leaves out

DISPLACED = frozenset({"surfaces", "time_code"})  # also where materials displace surfaces


def without_sampling_settings(settings: RenderSettings) -> RenderSettings:
    """Return the settings without those that only sampling depends on."""
    return replace(settings, **{row.name: row.default for row in rows(type(settings)) if row.is_of_sampling})


@dataclass
class _Diced:
    given: SceneDescription
    asked: tuple[float, int | None, DefaultWrap]
    made: SceneDescription
    limits: Limits


@dataclass
class _Built:
    given: SceneDescription
    filtered: tuple[Filter, float | None]
    scene: CoreScene
    looks: tuple[int | None, bool]  # the settings that its learnt path guides are valid for


@dataclass(frozen=True)
class _Judged:
    """Whether a stage that emission lights needs a studio light: the lights that were added, if any, and what was reported."""

    given: SceneDescription
    asked: tuple[object, ...]
    added: tuple[Light, ...] | None
    told: list[Diagnostic]


class SharedTranslation:
    """The translation of a stage, which the steps of several scenes may share, and the edits that it has not taken yet.

    `lock` is held by who reads or edits the stage; steps in other threads then wait.
    """

    def __init__(self, lock: AbstractContextManager[object] | None = None) -> None:
        from ..core import compiled
        from ..usd.incremental import Changes, KeptTranslation

        self.lock: AbstractContextManager[object] = threading.RLock() if lock is None else lock
        self.changes = Changes()
        self.kept = KeptTranslation(compiled.triangulate)

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        from ..usd.incremental import Changes

        with self.lock:
            changes, self.changes = self.changes, Changes()
            return self.kept.translate(stage, without_sampling_settings(settings), changes)


class CachedSteps(Steps):
    """Steps of one stage. `translation`: that of other steps, whose scenes differ in what is made after it."""

    def __init__(self, translation: SharedTranslation | None = None) -> None:
        self.translation = SharedTranslation() if translation is None else translation
        self.edits = 0  # of the stage that the last scene has (KeptStage.edits)
        self._is_whole = True
        self._out_of_core: tuple[object, ...] | None = None
        self._translation = self.translation.kept
        self._plain: dict[int, tuple[Surface, Surface]] = {}
        self._drop()

    def reading_stage(self) -> AbstractContextManager[object]:
        return self.translation.lock

    def forget(self) -> None:
        """Drop the results of all earlier renders."""
        self._translation.forget()
        self._drop()

    def _drop(self) -> None:
        self._loaded: LoadedTextures | None = None
        self._diced: _Diced | None = None
        self.diced_before = DicedBefore()
        self._counted: tuple[SceneDescription, float, Counts] | None = None
        self._digests: tuple[SceneDescription, dict[str, str]] | None = None
        self._built: _Built | None = None
        self._judged: _Judged | None = None

    @contextmanager
    def whole(self) -> Iterator[None]:
        """Drop all results if an error stops the steps halfway; an interruption of sampling does not affect them."""
        self._is_whole = False
        try:
            yield
        finally:
            if not self._is_whole:
                with self.reading_stage():
                    self.forget()

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        out_of_core = settings.texture_memory_bytes, settings.texture_cache, settings.texture_cache_bytes
        if self._out_of_core not in (None, out_of_core):
            self._drop()
        self._out_of_core = out_of_core
        if not self._files_are_the_same():
            with self.reading_stage():
                self.forget()
        return self.translation.translate(stage, settings)

    def without_images(self, description: SceneDescription) -> SceneDescription:
        """Return the description with surfaces that read no image files, the same ones as before where they are of the same."""
        before, self._plain = self._plain, {}
        for surface in description.surfaces:
            known = before.get(id(surface))
            self._plain[id(surface)] = known if known is not None else (surface, without_images(surface))
        return replace(description, surfaces=tuple(self._plain[id(surface)][1] for surface in description.surfaces))

    def _files_are_the_same(self) -> bool:
        loaded = self._loaded
        return loaded is None or (loaded.states is not None and file_states(loaded.states) == loaded.states)

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        kept, self._loaded = self._loaded, None
        textures: Textures = {}
        if kept is not None and kept.default_wrap is settings.default_wrap and kept.serves(description):
            self._loaded = replace(kept.of(description), fresh=frozenset())
        else:
            known = kept.files if kept is not None and kept.default_wrap is settings.default_wrap else {}
            with self.reading_stage():
                about = file_states(self._translation.files(description))
            told = partial(self.on_progress, "textures")
            self._loaded, textures = load(
                description, settings.default_wrap, about, diagnostics, known, told, tile_cache(settings)
            )
        diagnostics.extend(self._loaded.told)
        return self._loaded.made, textures

    def image_sizes(self, textures: Textures) -> list[ImageSize]:
        assert self._loaded is not None
        return self._loaded.images

    def _at_hand(self, textures: Textures, files: Collection[TextureFile] | None = None) -> Textures:
        """Add images of these files, or of all, that this render did not need so far; return `textures`."""
        if self._loaded is not None:
            for file, images in self._loaded.of_lights.items():
                textures.setdefault(file, images)
            textures.update(self._read(textures.keys(), self._loaded.sizes if files is None else files))
        return textures

    def _read(self, at_hand: Collection[TextureFile], files: Collection[TextureFile]) -> Textures:
        """Read files again that are not at hand."""
        loaded, missing = self._loaded, {file for file in files if file not in at_hand}
        if loaded is None or not missing:
            return {}
        wrap = Wrap(loaded.default_wrap.value)
        found = load_files(loaded.given, read_asset, wrap, only=missing, cache=loaded.cache)
        return images_of(found)

    def fingerprint(self, description: SceneDescription, textures: Textures) -> dict[str, str]:
        kept, self._digests = self._digests, None
        changed = differing_fields(kept[0], description) if kept is not None else ALL_FIELDS
        parts = {name for name in PARTS if changed.intersection(fields_of(name))}
        found = kept[1] if kept is not None else {}
        if parts:
            made = fingerprint_of(description, self._at_hand(textures), parts)
            found = {name: made.get(name, found.get(name, "")) for name in PARTS}
        self._digests = description, found
        return found

    def add_missing_light(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, diagnostics: Diagnostics
    ) -> SceneDescription:
        kept, self._judged = self._judged, None
        if not description.may_need_light:
            return description
        asked = settings.max_depth, settings.dicing_rate, settings.studio
        if kept is not None and kept.asked == asked and not differing_fields(kept.given, description) - NOT_JUDGED:
            lit = description if kept.added is None else replace(description, lights=kept.added)
            self._judged = replace(kept, given=description)
        else:
            from ..staging import with_studio_where_dark

            told = Diagnostics(diagnostics.shown)
            lit = with_studio_where_dark(description, settings, told, partial(self._test_scene, textures))
            self._judged = _Judged(description, asked, None if lit is description else lit.lights, list(told))
        diagnostics.extend(self._judged.told)
        return lit

    def _test_scene(self, textures: Textures, small: SceneDescription, quick: RenderSettings) -> CoreScene:
        """Return the scene of a test render: the kept one, updated, where only what may be updated differs; else a new one.

        The render that follows updates the kept scene again.
        """
        from .. import core

        files = _displacing_files(small)
        diced, _ = core.dice(small, quick, self._at_hand(textures, files) if files else textures)
        kept, self._built = self._built, None
        if kept is not None:
            looks, filtered = (quick.max_depth, quick.is_quick_look), (quick.pixel_filter, quick.filter_width)
            scene = self._again(kept, diced, filtered, looks, quick)
            if scene is not None:
                self._built = _Built(diced, filtered, scene, looks)
                return scene
            if kept.scene.is_there:
                self._built = kept
        return core.build(diced, dict(self._at_hand(textures)), quick)

    def dice(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings
    ) -> tuple[SceneDescription, Limits]:
        from .. import core

        kept, self._diced = self._diced, None
        asked = settings.dicing_rate, settings.max_memory_bytes, settings.default_wrap
        is_displaced = any(surface.displacement is not None for surface in description.surfaces)
        counting = SHAPED | LOOKED_AT | DISPLACED if is_displaced else SHAPED | LOOKED_AT
        if kept is None or kept.asked != asked or differing_fields(kept.given, description) & counting:
            if kept is None or kept.asked[2] != asked[2]:
                self.diced_before = DicedBefore()  # displacements that read textures are known by their files alone
            at_hand = partial(self._at_hand, textures, _displacing_files(description)) if is_displaced else textures
            made, limits = core.dice(description, settings, at_hand, self.diced_before, partial(self.on_progress, "dice"))
        else:
            made, limits = replace(description, shapes=kept.made.shapes), kept.limits
        self._diced = _Diced(description, asked, made, limits)
        return made, limits

    def count(self, description: SceneDescription, settings: RenderSettings, images: list[ImageSize]) -> Counts:
        kept, self._counted = self._counted, None
        is_known = kept is not None and kept[1] == settings.dicing_rate and counts_alike(kept[0], description)
        counted = kept[2] if kept and is_known else super().count(description, settings, images)
        self._counted = description, settings.dicing_rate, counted
        return counted

    def build(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, shapes: list[Shape]
    ) -> CoreScene:
        kept, self._built = self._built, None
        description = replace(description, shapes=tuple(shapes))
        looks, filtered = (settings.max_depth, settings.is_quick_look), (settings.pixel_filter, settings.filter_width)
        scene = None if kept is None else self._again(kept, description, filtered, looks, settings)
        if scene is None:
            self.on_progress("build", 0, 0)
            self.kept_images = None if kept is None else self._images_of(kept.scene, textures)
            kept = None  # freed before another one takes memory
            scene = super().build(
                description, self._at_hand(textures) if self.kept_images is None else textures, settings, shapes
            )
            self.kept_images = None
        self._built = _Built(description, filtered, scene, looks)
        self._is_whole = True
        return scene

    def _again(
        self, kept: _Built, now: SceneDescription, filtered: Any, looks: Any, settings: RenderSettings
    ) -> CoreScene | None:
        """Return the earlier scene, updated where needed; None where it has to be rebuilt."""
        from .core_update import updated_core_scene

        changed = differing_fields(kept.given, now)
        if changed or kept.filtered != filtered:
            assert self._loaded is not None
            lit = self._loaded.of_lights
            read = partial(self._read, lit.keys())
            return updated_core_scene(kept.scene, kept.given, now, changed, lit, read, settings)
        if looks != kept.looks:
            kept.scene.forget_guides()
        return kept.scene

    def _images_of(self, scene: CoreScene, textures: Textures) -> KeptImages | None:
        """Return the core's images of a scene, but those of files that were loaded for this render; add sizes to textures."""
        from .core_update import kept_images

        loaded = self._loaded
        assert loaded is not None
        images = kept_images(scene, loaded.fresh, partial(self._read, {*loaded.of_lights, *textures}))
        if images is not None:
            textures.update({file: tiles for file, tiles in loaded.sizes.items() if file not in textures})
        return images


@dataclass(frozen=True)
class LoadedTextures:
    given: SceneDescription
    default_wrap: DefaultWrap
    made: SceneDescription
    read_diagnostics: list[Diagnostic]
    light_diagnostics: list[Diagnostic]
    images: list[ImageSize]
    files: dict[TextureFile, LoadedFile]  # all, without texels but for those of lights
    fresh: frozenset[TextureFile]  # those that the latest render has read
    states: FileStates | None
    cache: TileCache | None = None

    @property
    def told(self) -> list[Diagnostic]:
        return [*self.read_diagnostics, *self.light_diagnostics]

    @property
    def sizes(self) -> Textures:
        """Return all that could be read; texels are there of lights alone."""
        return images_of(self.files)

    @property
    def of_lights(self) -> Textures:
        """Return images of lights, from which their power is computed."""
        lit = _light_files(self.given)
        return {file: images for file, images in self.sizes.items() if file in lit}

    def serves(self, description: SceneDescription) -> bool:
        """Return whether loading this description would find and report the same."""
        changed = differing_fields(self.given, description)
        if not changed:
            return True
        if changed & {"shapes", "prototypes", "placements"} or _light_files(self.given) != _light_files(description):
            return False
        before, now = ([(s.inputs, s.pattern) for s in d.surfaces] for d in (self.given, description))
        return not self.images or before == now

    def of(self, description: SceneDescription) -> LoadedTextures:
        """Return the loaded textures for a description that they serve."""
        if description is self.given:
            return self
        told = Diagnostics()
        made = replace(description, lights=with_read_textures(description.lights, self.of_lights, told))
        return replace(self, given=description, made=made, light_diagnostics=list(told))


def load(
    description: SceneDescription,
    default_wrap: DefaultWrap,
    states: FileStates | None,
    heard: Diagnostics,
    known: Mapping[TextureFile, LoadedFile],
    on_image: Callable[[int, int], None] | None = None,
    cache: TileCache | None = None,
) -> tuple[LoadedTextures, Textures]:
    """Load textures, but for those in `known` that have the same readers; return all that is known now, and what was read.

    Diagnostics are kept, not reported; `heard` only decides how they name files.
    """
    read_diagnostics, light_diagnostics = Diagnostics(heard.shown), Diagnostics(heard.shown)
    found = read_files(description, read_diagnostics, read_asset, Wrap(default_wrap.value), known, on_image, cache)
    textures = images_of(found)
    made = replace(description, lights=with_read_textures(description.lights, textures, light_diagnostics))
    lit, sizes = _light_files(description), dict[int, Texture]()
    fresh = frozenset(file for file, one in found.items() if one is not known.get(file))
    loaded = LoadedTextures(
        given=description,
        default_wrap=default_wrap,
        made=made,
        read_diagnostics=list(read_diagnostics),
        light_diagnostics=list(light_diagnostics),
        images=image_sizes(textures),
        cache=cache,
        files={file: one if file in lit else one.without_texels(sizes) for file, one in found.items()},
        fresh=fresh,
        states=states,
    )
    return loaded, {file: images for file, images in textures.items() if file in fresh}


def _displacing_files(description: SceneDescription) -> list[TextureFile]:
    """Return files of all surfaces that are displaced."""
    found: list[TextureFile] = []
    for surface in description.surfaces:
        if surface.displacement is not None:
            found += [reads.file for _, reads in surface.inputs if isinstance(reads, TextureInput)]
            found += pattern_files(surface.pattern) if surface.pattern else ()
    return found


def _light_files(description: SceneDescription) -> list[TextureFile]:
    return [light.texture for light in description.lights if light.texture is not None]


def read_asset(path: str) -> bytes:
    from .. import usd

    return usd.read_asset(path)


FileStates = dict[str, tuple[int, ...]]


def file_states(paths: Iterable[str]) -> FileStates | None:
    """Return the state of files and folders, for members of packages that of the package; None where one does not exist."""
    found: FileStates = {}
    for path in paths:
        try:
            about = os.stat(path.partition("[")[0])
        except (OSError, ValueError):
            return None
        found[path] = about.st_mtime_ns, about.st_size, about.st_ino
    return found


_LONG = frozenset({"shapes", "static", "prototypes", "placements", "lights", "surfaces"})

_IGNORED_FIELD = "asked"  # the stage's requests to the renderer: no part of a scene depends on it
ALL_FIELDS = frozenset(f.name for f in fields(SceneDescription))


def differing_fields(one: SceneDescription, other: SceneDescription) -> frozenset[str]:
    """Return the names of fields that differ. Long fields built twice from the same input count as different."""
    if one is other:
        return frozenset()
    return frozenset(
        f.name
        for f in fields(one)
        if f.name != _IGNORED_FIELD and not _same_field(f.name, getattr(one, f.name), getattr(other, f.name))
    )


def same_items(some: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    """Return whether both have the very same objects, in order."""
    return some is others or (len(some) == len(others) and all(map(lambda a, b: a is b, some, others)))


def same(one: Any, other: Any) -> bool:
    """Return whether two values, such as dataclasses of numbers and arrays, are equal."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if is_dataclass(one):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return bool(one == other)


def counts_alike(one: SceneDescription, other: SceneDescription) -> bool:
    """Return whether two diced descriptions have the same numbers of everything and the same images."""
    long = ("lights", "surfaces")
    return not differing_fields(one, other) - {*long, "static", "camera", "time_code"} and (
        all(len(getattr(one, name)) == len(getattr(other, name)) for name in long)
        and [p.shape for p in one.static] == [p.shape for p in other.static]
        and [(s.inputs, s.pattern) for s in one.surfaces] == [(s.inputs, s.pattern) for s in other.surfaces]
        and [light.texture for light in one.lights] == [light.texture for light in other.lights]
    )


def _same_field(name: str, one: Any, other: Any) -> bool:
    return same_items(one, other) if name in _LONG else same(one, other)


KEPT_PART = 0.125  # of the available memory: a larger process keeps nothing


class MemoryLimitedSteps(CachedSteps):
    def build(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, shapes: list[Shape]
    ) -> CoreScene:
        scene = super().build(description, textures, settings, shapes)
        there_is = machine_bytes()
        if settings.max_memory_bytes is not None:
            there_is = min(there_is, settings.max_memory_bytes)
        if resident_bytes() > KEPT_PART * there_is:
            self.forget()
        return scene
