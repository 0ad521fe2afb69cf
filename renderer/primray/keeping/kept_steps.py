"""The steps of preparing a render, with what earlier ones made: each is taken again only where what it is made of has changed.

A step knows that by the very objects that it is given: what a translation keeps it hands on as it was.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..render.steps import Steps, image_sizes
from ..settings import Metric, RenderSettings
from .asset_files import State, state_of
from .differing import differing

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..description import SceneDescription, Shape
    from ..diagnostics import Diagnostic, Diagnostics
    from ..render.steps import Textures
    from ..report.summary import ImageSize

    Limits = list[tuple[str, str, str]]
    Counts = tuple[dict[str, int], dict[str, Any] | None]

# What decides how finely cages are diced, and how much there is of everything.
SHAPED = frozenset({"shapes", "static", "prototypes", "placements"})
LOOKED_AT = frozenset({"camera", "camera_motion", "exposure", "resolution", "pixels", "pixel_aspect_ratio"})


def lasting(settings: RenderSettings) -> RenderSettings:
    """Without what is for sampling alone."""
    return replace(
        settings,
        spp=None,
        target_error=None,
        error_metric=Metric.RELMSE,
        time_limit_s=None,
        adaptive=None,
        sample_range=None,
        max_depth=None,
        threads=None,
        seed=0,
    )


@dataclass
class _Loaded:
    given: SceneDescription
    made: SceneDescription
    told: list[Diagnostic]
    images: list[ImageSize]
    files: State | None


@dataclass
class _Built:
    given: SceneDescription
    scene: CoreScene
    looks: tuple[int | None, bool]  # what guides that it has learnt are for


class KeptSteps(Steps):
    """Of one stage; `changes` are those that its translation does not know of yet."""

    def __init__(self) -> None:
        from ..usd.keeping import Changes, KeptTranslation

        self.changes = Changes()
        self._is_whole = True
        self._translation = KeptTranslation()
        self._settings: RenderSettings | None = None
        self.forget()

    def forget(self) -> None:
        """Whatever an earlier render made."""
        self._translation.forget()
        self._loaded: _Loaded | None = None
        self._diced: tuple[SceneDescription, SceneDescription, Limits] | None = None
        self._counted: tuple[SceneDescription, Counts] | None = None
        self._digests: tuple[SceneDescription, dict[str, str]] | None = None
        self._built: _Built | None = None

    @contextmanager
    def whole(self) -> Iterator[None]:
        """Steps that an error stops half way leave nothing behind; what stops sampling does not touch them."""
        self._is_whole = False
        try:
            yield
        finally:
            if not self._is_whole:
                self.forget()

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        from ..usd.keeping import Changes

        kept = lasting(settings)
        if kept != self._settings or not self._files_are_the_same():
            self.forget()
        self._settings = kept
        changes, self.changes = self.changes, Changes()
        return self._translation.translate(stage, kept, changes)

    def _files_are_the_same(self) -> bool:
        loaded = self._loaded
        return loaded is None or (loaded.files is not None and state_of(loaded.files) == loaded.files)

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        kept, self._loaded = self._loaded, None
        if kept is not None and kept.given is description:
            self._loaded = kept
            diagnostics.extend(kept.told)
            return kept.made, {}
        from ..diagnostics import Diagnostics

        told, files = Diagnostics(diagnostics.shown), state_of(self._translation.files(description))
        made, textures = super().load_textures(description, told, settings)
        self._loaded = _Loaded(description, made, list(told), image_sizes(textures), files)
        diagnostics.extend(told)
        return made, textures

    def image_sizes(self, textures: Textures) -> list[ImageSize]:
        assert self._loaded is not None
        return self._loaded.images

    def fingerprint(self, description: SceneDescription, textures: Textures) -> dict[str, str]:
        if self._digests is None or self._digests[0] is not description:
            self._digests = description, super().fingerprint(description, textures)
        return self._digests[1]

    def dice(self, description: SceneDescription, settings: RenderSettings) -> tuple[SceneDescription, Limits]:
        kept, self._diced = self._diced, None
        if kept is None or differing(kept[0], description) & (SHAPED | LOOKED_AT):
            made, limits = super().dice(description, settings)
        else:
            made, limits = replace(description, shapes=kept[1].shapes), kept[2]
        self._diced = description, made, limits
        return made, limits

    def count(self, description: SceneDescription, settings: RenderSettings, images: list[ImageSize]) -> Counts:
        kept, self._counted = self._counted, None
        is_known = kept is not None and not differing(kept[0], description)
        self._counted = description, kept[1] if kept and is_known else super().count(description, settings, images)
        return self._counted[1]

    def build(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, shapes: list[Shape]
    ) -> CoreScene:
        kept, self._built = self._built, None
        description = replace(description, shapes=tuple(shapes))
        looks = settings.max_depth, settings.is_quick_look
        if kept is not None and not differing(kept.given, description):
            scene = kept.scene
            if looks != kept.looks:
                scene.forget_guides()
        else:
            scene = super().build(description, textures, settings, shapes)
        self._built = _Built(description, scene, looks)
        self._is_whole = True
        return scene
