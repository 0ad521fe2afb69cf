"""Textures of a description as one render loaded them, and whether another render and its lights can use them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from ..description import SceneDescription, TextureFile, Wrap
from ..diagnostics import Diagnostic, Diagnostics
from ..render.steps import Textures, image_sizes, read_textures
from ..report.summary import ImageSize
from ..settings import DefaultWrap
from ..textures.texture_set import with_read_textures
from .asset_files import State, state_of
from .differing import differing


@dataclass(frozen=True)
class Loaded:
    given: SceneDescription
    default_wrap: DefaultWrap
    made: SceneDescription
    read_told: list[Diagnostic]
    lights_told: list[Diagnostic]
    images: list[ImageSize]
    of_lights: Textures  # images of lights, from which their power is computed
    files: State | None

    @property
    def told(self) -> list[Diagnostic]:
        return [*self.read_told, *self.lights_told]

    def serves(self, description: SceneDescription) -> bool:
        """Return whether loading this description would find and report the same."""
        changed = differing(self.given, description)
        if not changed:
            return True
        if changed & {"shapes", "prototypes", "placements"} or _light_files(self.given) != _light_files(description):
            return False
        before, now = ([(s.inputs, s.pattern) for s in d.surfaces] for d in (self.given, description))
        return not self.images or before == now

    def of(self, description: SceneDescription) -> Loaded:
        """Return the loaded textures for a description that they serve."""
        if description is self.given:
            return self
        told = Diagnostics()
        made = replace(description, lights=with_read_textures(description.lights, self.of_lights, told))
        return replace(self, given=description, made=made, lights_told=list(told))


def load(
    description: SceneDescription, default_wrap: DefaultWrap, files: Iterable[str], heard: Diagnostics
) -> tuple[Loaded, Textures]:
    """Load textures. Diagnostics are kept, not reported; `heard` only decides how they name files."""
    from .. import usd

    state = state_of(files)
    read_told, lights_told = Diagnostics(heard.shown), Diagnostics(heard.shown)
    textures = read_textures(description, read_told, usd.read_asset, Wrap(default_wrap.value))
    made = replace(description, lights=with_read_textures(description.lights, textures, lights_told))
    lit = {file: textures[file] for file in _light_files(description) if file in textures}
    told = list(read_told), list(lights_told)
    return Loaded(description, default_wrap, made, *told, image_sizes(textures), lit, state), textures


def _light_files(description: SceneDescription) -> list[TextureFile]:
    return [light.texture for light in description.lights if light.texture is not None]
