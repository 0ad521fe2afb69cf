"""Report of textures that cannot be seen: black outside 0 to 1, where all texture coordinates of a surface are.

This follows UsdUVTexture, whose wraps are black unless the stage or the file says otherwise, but is rarely intended.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ..description import SceneDescription, Shape, TextureFile, TextureInput, Wrap
from ..description.open_pbr import PREFIX
from ..diagnostics import Diagnostics
from .texture import Texture

Textures = Mapping[TextureFile, Sequence[tuple[int, Texture]]]


def note_textures_outside(description: SceneDescription, textures: Textures, diagnostics: Diagnostics) -> None:
    """Report the textures of each surface that cannot be seen."""
    black: dict[int, list[tuple[str, TextureInput, list[int]]]] = {}
    for number, surface in enumerate(description.surfaces):
        for name, reads in surface.inputs:
            axes = _black_axes(reads, textures.get(reads.file, ())) if isinstance(reads, TextureInput) else []
            if isinstance(reads, TextureInput) and axes:
                black.setdefault(number, []).append((name, reads, axes))
    shapes = _shapes_of(description.shapes, black) if black else {}
    for number, found in shapes.items():
        for name, reads, axes in black[number]:
            if all(_outside(shape, reads, axes) for shape in found):  # usually decided by the first shape
                diagnostics.add("texture-outside", description.surfaces[number].path, _sentence(name, reads))


def _sentence(name: str, reads: TextureInput) -> str:
    unsaid = Wrap.USE_METADATA in (reads.wrap_s, reads.wrap_t)
    why = "no wrap mode is set, which means black: use --default-wrap repeat" if unsaid else "its wrap modes are black"
    name = name.removeprefix(PREFIX)
    return f"{name} is black: all its texture coordinates are outside 0 to 1, and {why}. ({reads.file.path})"


def _black_axes(reads: TextureInput, tiles: Sequence[tuple[int, Texture]]) -> list[int]:
    """Return the axes, of s and t, along which the image is black outside; sets of tiles have none."""
    if len(tiles) != 1 or tiles[0][0]:
        return []
    own = tiles[0][1].wrap_s, tiles[0][1].wrap_t
    wraps = [says if wrap is Wrap.USE_METADATA else wrap for wrap, says in zip((reads.wrap_s, reads.wrap_t), own, strict=True)]
    return [axis for axis, wrap in enumerate(wraps) if wrap is Wrap.BLACK]


def _shapes_of(shapes: Sequence[Shape], surfaces: Collection[int]) -> dict[int, list[Shape]]:
    found: dict[int, list[Shape]] = {}
    for shape in shapes:
        for number in [shape.surface] if isinstance(shape.surface, int) else np.unique(shape.surface).tolist():
            if number in surfaces:
                found.setdefault(number, []).append(shape)
    return found


def _outside(shape: Shape, reads: TextureInput, axes: Sequence[int]) -> bool:
    """Return whether a shape's coordinates are all outside along an axis; without the primvar, the fallback is inside."""
    for primvar in shape.primvars:
        values = primvar.values
        if primvar.name == reads.st.name and values.ndim == 2 and values.shape[1] >= 2 and len(values):
            m = np.asarray(reads.st_transform, np.float64).reshape(2, 3)
            moved = [values[:, 0] * m[axis, 0] + values[:, 1] * m[axis, 1] + m[axis, 2] for axis in axes]
            return any((v.max() <= 0 and v.min() < 0) or (v.min() >= 1 and v.max() > 1) for v in moved)
    return False
