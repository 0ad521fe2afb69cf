"""The steps that prepare a render. Each is a method, so that subclasses can reuse results of earlier renders."""

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
    """The steps in their order, without caching."""

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        from .. import usd

        return usd.translate(stage, settings)

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        from .. import usd

        return load_textures(description, diagnostics, usd.read_asset, settings.default_wrap)

    def image_sizes(self, textures: Textures) -> list[ImageSize]:
        """Return the sizes of the images just loaded."""
        return image_sizes(textures)

    def fingerprint(self, description: SceneDescription, textures: Textures) -> dict[str, str]:
        from ..checkpoints.fingerprint import fingerprint

        return fingerprint(description, textures)

    def dice(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings
    ) -> tuple[SceneDescription, list[tuple[str, str, str]]]:
        """Return the diced description, and code, path and message of approximations."""
        from .. import core

        return core.dice(description, settings, textures)

    def count(
        self, description: SceneDescription, settings: RenderSettings, images: list[ImageSize]
    ) -> tuple[dict[str, int], dict[str, Any] | None]:
        """Return the report's counts of scene contents, and its facts about motion."""
        from ..report.summary import counts, motion_facts, summary

        return counts(summary(description, settings.dicing_rate, images)), motion_facts(description)

    def add_missing_light(
        self, description: SceneDescription, textures: Textures, settings: RenderSettings, diagnostics: Diagnostics
    ) -> SceneDescription:
        """Return the description with a studio light, if emissive surfaces light too little of what is visible."""
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
        """Build the scene; `textures`, and `shapes`, which replaces the description's, are emptied on the way to save
        memory."""
        from .. import core

        return core.build(description, textures, settings, shapes)


def load_textures(
    description: SceneDescription,
    diagnostics: Diagnostics,
    read: Callable[[str], bytes] | None,
    default_wrap: DefaultWrap = DefaultWrap.BLACK,
) -> tuple[SceneDescription, Textures]:
    """Return the description, and the images of every file that could be read, with tile numbers or 0.

    Domes whose texture cannot be read are removed; each unreadable file is a diagnostic.
    """
    from ..description import Wrap
    from ..textures.texture_set import with_read_textures

    textures = read_textures(description, diagnostics, read, Wrap(default_wrap.value))
    return replace(description, lights=with_read_textures(description.lights, textures, diagnostics)), textures


def read_textures(
    description: SceneDescription, diagnostics: Diagnostics, read: Callable[[str], bytes] | None, default_wrap: Wrap
) -> Textures:
    """Return the images only, with diagnostics about them."""
    from ..textures.coverage import note_missing_tiles, note_textures_outside
    from ..textures.texture_set import load_texture_set

    textures = load_texture_set(description, diagnostics, read, default_wrap)
    note_textures_outside(description, textures, diagnostics)
    note_missing_tiles(description, diagnostics)
    return textures


def image_sizes(textures: Textures) -> list[ImageSize]:
    """Return the sizes of distinct images, each counted once."""
    from ..report.summary import ImageSize

    different = {id(image): image for images in textures.values() for _, image in images}
    return [ImageSize(i.shape[1], i.shape[0], i.shape[2], i.stored.itemsize) for i in different.values()]
