"""A stage's translation that outlives edits: made anew as far as they touch it, always what a new one would be."""

from __future__ import annotations

import os
from collections.abc import Iterator

from pxr import Usd

from ...description import SceneDescription, TextureFile, TextureInput
from ...diagnostics import Diagnostics
from ...settings import RenderSettings
from ..translate import translate
from .changes import Changes


class KeptTranslation:
    """Of one stage. What an edit does is known for some kinds of it; any other has everything translated again."""

    def __init__(self) -> None:
        self._settings: RenderSettings | None = None
        self._made: tuple[SceneDescription, Diagnostics] | None = None

    def translate(self, stage: Usd.Stage, settings: RenderSettings, changes: Changes) -> tuple[SceneDescription, Diagnostics]:
        """As usd.translate does; the very description of before, or its very parts, where they are the same."""
        made, self._made = self._made, None  # for if it fails
        if made is None or changes or settings != self._settings:
            made = translate(stage, settings)
        self._settings, self._made = settings, made
        return made

    def forget(self) -> None:
        self._made = self._settings = None

    def files(self, description: SceneDescription) -> Iterator[str]:
        """All but layers that it was made of, and folders where more of them would be."""
        for file in _texture_files(description):
            if not file.tiles:
                yield file.path
            for _, path in file.tiles:
                yield path
                yield os.path.dirname(path)


def _texture_files(description: SceneDescription) -> Iterator[TextureFile]:
    yield from (light.texture for light in description.lights if light.texture is not None)
    for surface in description.surfaces:
        yield from (reads.file for _, reads in surface.inputs if isinstance(reads, TextureInput))
