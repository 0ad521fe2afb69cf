"""Loading of all textures of a description, for tests."""

from __future__ import annotations

from primray.description import SceneDescription, Wrap
from primray.diagnostics import Diagnostics
from primray.textures.texture_set import TextureSet, images_of, load_files


def load_texture_set(
    description: SceneDescription, diagnostics: Diagnostics, read: None = None, default_wrap: Wrap = Wrap.BLACK
) -> TextureSet:
    """Return the images that could be read."""
    files = load_files(description, read, default_wrap, diagnostics.shown)
    for one in files.values():
        diagnostics.extend(one.told)
    return images_of(files)
