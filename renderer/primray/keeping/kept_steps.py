"""The steps of preparing a render with the results of earlier ones: a step is repeated only if its inputs have changed.

Inputs are compared by identity: an incremental translation returns unchanged parts as the same objects.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..checkpoints.fingerprint import PARTS, fingerprint_of
from ..render.steps import Steps
from ..settings import Filter, RenderSettings
from .asset_files import state_of
from .differing import ALL, counts_alike, differing
from .loaded import Loaded, load

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..description import SceneDescription, Shape
    from ..diagnostics import Diagnostics
    from ..render.steps import Textures
    from ..report.summary import ImageSize

    Limits = list[tuple[str, str, str]]
    Counts = tuple[dict[str, int], dict[str, Any] | None]

# Fields that decide how finely control cages are diced.
SHAPED = frozenset({"shapes", "static", "prototypes", "placements"})
LOOKED_AT = frozenset({"camera", "camera_motion", "exposure", "resolution", "pixels", "pixel_aspect_ratio"})

DISPLACED = frozenset({"surfaces", "time_code"})  # also where materials displace surfaces


def lasting(settings: RenderSettings) -> RenderSettings:
    """Return the settings without those that only sampling depends on."""
    return replace(
        settings,
        spp=None,
        target_error=None,
        error_metric=None,
        time_limit_s=None,
        adaptive=None,
        sample_range=None,
        max_depth=None,
        clamp_indirect=None,
        caustics=True,
        threads=None,
        seed=0,
        ground=None,
        background=None,
        orbit_deg=0.0,
    )


@dataclass
class _Diced:
    given: SceneDescription
    asked: tuple[float, int | None]
    made: SceneDescription
    limits: Limits


@dataclass
class _Built:
    given: SceneDescription
    filtered: tuple[Filter, float | None]
    scene: CoreScene
    looks: tuple[int | None, bool]  # the settings that its learnt path guides are valid for


class KeptSteps(Steps):
    """Steps of one stage; `changes` are those that its translation has not taken yet."""

    def __init__(self) -> None:
        from ..usd.keeping import Changes, KeptTranslation

        self.changes = Changes()
        self._is_whole = True
        self._translation = KeptTranslation()
        self.forget()

    def forget(self) -> None:
        """Drop the results of all earlier renders."""
        self._translation.forget()
        self._loaded: Loaded | None = None
        self._diced: _Diced | None = None
        self._counted: tuple[SceneDescription, float, Counts] | None = None
        self._digests: tuple[SceneDescription, dict[str, str]] | None = None
        self._built: _Built | None = None

    @contextmanager
    def whole(self) -> Iterator[None]:
        """Drop all results if an error stops the steps halfway; an interruption of sampling does not affect them."""
        self._is_whole = False
        try:
            yield
        finally:
            if not self._is_whole:
                self.forget()

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        from ..usd.keeping import Changes

        if not self._files_are_the_same():
            self.forget()
        changes, self.changes = self.changes, Changes()
        return self._translation.translate(stage, lasting(settings), changes)

    def _files_are_the_same(self) -> bool:
        loaded = self._loaded
        return loaded is None or (loaded.files is not None and state_of(loaded.files) == loaded.files)

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        kept, self._loaded = self._loaded, None
        textures: Textures = {}
        if kept is not None and kept.default_wrap is settings.default_wrap and kept.serves(description):
            self._loaded = kept.of(description)
        else:
            self._loaded, textures = load(description, settings.default_wrap, self._translation.files(description), diagnostics)
        diagnostics.extend(self._loaded.told)
        return self._loaded.made, textures

    def image_sizes(self, textures: Textures) -> list[ImageSize]:
        assert self._loaded is not None
        return self._loaded.images

    def _at_hand(self, textures: Textures) -> Textures:
        """Return all textures, read again where this render did not need them so far."""
        if textures or self._loaded is None or not self._loaded.images:
            return textures
        from ..diagnostics import Diagnostics

        return load(self._loaded.given, self._loaded.default_wrap, (), Diagnostics())[1]

    def fingerprint(self, description: SceneDescription, textures: Textures) -> dict[str, str]:
        kept, self._digests = self._digests, None
        changed = differing(kept[0], description) if kept is not None else ALL
        parts = {name for name, fields in PARTS.items() if changed.intersection(fields)}
        found = kept[1] if kept is not None else {}
        if parts:
            made = fingerprint_of(description, self._at_hand(textures), parts)
            found = {name: made.get(name, found.get(name, "")) for name in PARTS}
        self._digests = description, found
        return found

    def add_missing_light(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, diagnostics: Diagnostics
    ) -> SceneDescription:
        if not description.may_need_light:
            return description
        return super().add_missing_light(description, self._at_hand(textures), settings, diagnostics)

    def dice(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings
    ) -> tuple[SceneDescription, Limits]:
        kept, self._diced = self._diced, None
        asked = settings.dicing_rate, settings.max_memory_bytes
        is_displaced = any(surface.displacement is not None for surface in description.surfaces)
        counting = SHAPED | LOOKED_AT | DISPLACED if is_displaced else SHAPED | LOOKED_AT
        if kept is None or kept.asked != asked or differing(kept.given, description) & counting:
            at_hand = self._at_hand(textures) if is_displaced else textures
            made, limits = super().dice(description, at_hand, settings)
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
            kept = None  # freed before another one takes memory
            scene = super().build(description, self._at_hand(textures), settings, shapes)
        self._built = _Built(description, filtered, scene, looks)
        self._is_whole = True
        return scene

    def _again(
        self, kept: _Built, now: SceneDescription, filtered: Any, looks: Any, settings: RenderSettings
    ) -> CoreScene | None:
        """Return the earlier scene, updated where needed; None where it has to be rebuilt."""
        from .core_scene_again import build_again

        changed = differing(kept.given, now)
        if changed or kept.filtered != filtered:
            assert self._loaded is not None
            return build_again(kept.scene, kept.given, now, changed, self._loaded.of_lights, settings)
        if looks != kept.looks:
            kept.scene.forget_guides()
        return kept.scene
