"""What a render is prepared in, step by step. Each is a method, for those who have something of it from an earlier render."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..settings import DefaultWrap, RenderSettings

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..description import SceneDescription, Shape, TextureFile, Wrap
    from ..diagnostics import Diagnostics
    from ..report.summary import ImageSize
    from ..textures.texture import Texture


Textures = dict["TextureFile", "list[tuple[int, Texture]]"]


class Steps:
    """In their order; nothing is kept."""

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        from .. import usd

        return usd.translate(stage, settings)

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        from .. import usd

        return load_textures(description, diagnostics, usd.read_asset, settings.default_wrap)

    def image_sizes(self, textures: Textures) -> list[ImageSize]:
        """Of what has just been loaded."""
        return image_sizes(textures)

    def fingerprint(self, description: SceneDescription, textures: Textures) -> dict[str, str]:
        from ..checkpoints.fingerprint import fingerprint

        return fingerprint(description, textures)

    def dice(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings
    ) -> tuple[SceneDescription, list[tuple[str, str, str]]]:
        """And code, path and message of what had to be approximated."""
        from .. import core

        return core.dice(description, settings, textures)

    def count(
        self, description: SceneDescription, settings: RenderSettings, images: list[ImageSize]
    ) -> tuple[dict[str, int], dict[str, Any] | None]:
        """What the report says of how much there is, and of what moves."""
        from ..report.motion import motion_facts
        from ..report.summary import counts, summary

        return counts(summary(description, settings.dicing_rate, images)), motion_facts(description)

    def add_missing_light(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, diagnostics: Diagnostics
    ) -> SceneDescription:
        """Return the description with a studio light where what glows lights too little of what is seen."""
        if not description.may_need_light:
            return description
        from .. import core
        from ..staging import with_studio_where_dark

        def build(small: SceneDescription, quick: RenderSettings) -> CoreScene:
            diced, _ = core.dice(small, quick, textures)
            return core.build(diced, dict(textures), quick)

        return with_studio_where_dark(description, settings, diagnostics, build)

    def build(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, shapes: list[Shape]
    ) -> CoreScene:
        """Empties `textures`, and `shapes`, which stand for the description's: they are let go on the way."""
        from .. import core

        return core.build(description, textures, settings, shapes)


def load_textures(
    description: SceneDescription,
    diagnostics: Diagnostics,
    read: Callable[[str], bytes] | None,
    default_wrap: DefaultWrap = DefaultWrap.BLACK,
) -> tuple[SceneDescription, Textures]:
    """The images of every file that could be read (with their tiles' numbers, or 0), and the description without the domes
    whose texture could not; each file that could not is a diagnostic."""
    from ..description import Wrap
    from ..textures.light_textures import with_read_textures

    textures = read_textures(description, diagnostics, read, Wrap(default_wrap.value))
    return replace(description, lights=with_read_textures(description.lights, textures, diagnostics)), textures


def read_textures(
    description: SceneDescription, diagnostics: Diagnostics, read: Callable[[str], bytes] | None, default_wrap: Wrap
) -> Textures:
    """The images alone, with what there is to tell of them."""
    from ..textures.missing_tiles import note_missing_tiles
    from ..textures.texture_outside import note_textures_outside
    from ..textures.texture_set import load_texture_set

    textures = load_texture_set(description, diagnostics, read, default_wrap)
    note_textures_outside(description, textures, diagnostics)
    note_missing_tiles(description, diagnostics)
    return textures


def image_sizes(textures: Textures) -> list[ImageSize]:
    """Of images that are held once, whoever reads them."""
    from ..report.summary import ImageSize

    different = {id(image): image for images in textures.values() for _, image in images}
    return [ImageSize(i.shape[1], i.shape[0], i.shape[2], i.stored.itemsize) for i in different.values()]
