"""Reports of texture coordinates that lie where a texture has no texels, after a scene's textures are read.

UDIM tiles that texture coordinates use and that do not exist show the fallback. Textures are invisible where they are black
outside 0 to 1 and all texture coordinates of a surface are there: that follows UsdUVTexture, whose wraps are black unless the
stage or the file says otherwise, but is rarely intended.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, Ints
from ..description import (
    Curves,
    Interpolation,
    Mesh,
    Ribbons,
    SceneDescription,
    Shape,
    SubdivisionMesh,
    Surface,
    TextureFile,
    TextureInput,
    Wrap,
)
from ..description.shading import OPEN_PBR_PREFIX, plain_images
from ..diagnostics import Diagnostics
from .texture import Texture

FIRST, ACROSS = 1001, 10  # ten tiles in s, then the next row in t (UsdShade: 1001 to 1100)
_NEAR = 1e-4  # of a tile: smaller overlaps are rounding, or a bevel at its border
_AT_ONCE = 1 << 18  # triangles
_LISTED = 8
_OUTSIDE = 0  # pseudo-tile: outside of all tiles

Triangles = npt.NDArray[np.float64]  # (K, 3, 2) of texture coordinates


def note_missing_tiles(description: SceneDescription, diagnostics: Diagnostics) -> None:
    """Report the missing tiles of each surface."""
    by_surface: dict[int, list[Shape]] | None = None
    per_instance = {p.name for placement in description.placements for p in placement.primvars}
    for number, surface in enumerate(description.surfaces):
        for file, inputs in _sets_of(surface).items():
            if by_surface is None:
                by_surface = _by_surface(description)
            there = {tile for tile, _ in file.tiles}
            used: set[int] = set()
            for reads in inputs:
                for shape in by_surface.get(number, []):
                    for st in _coordinates(shape, number, reads, per_instance):
                        used |= overlapped_tiles(_transformed(st, reads), there | used)
            if used - there:
                diagnostics.add("tile-missing", surface.path, _missing_message(file, sorted(used - there)))


def _missing_message(file: TextureFile, missing: list[int]) -> str:
    tiles = [str(tile) for tile in missing if tile != _OUTSIDE]
    more = f" and {len(tiles) - _LISTED} more" if len(tiles) > _LISTED else ""
    parts = [f"{file.path} lacks tiles that texture coordinates use: {', '.join(tiles[:_LISTED])}{more}"] if tiles else []
    if _OUTSIDE in missing:
        parts.append(f"{'some' if parts else f'{file.path}: some'} coordinates are outside of all tiles (1001 to 1100)")
    return f"{'; '.join(parts)}. The fallback is visible there."


def _sets_of(surface: Surface) -> dict[TextureFile, list[TextureInput]]:
    """Return the inputs that read a set of tiles, each different placement once."""
    found: dict[TextureFile, dict[object, TextureInput]] = {}
    for reads in (*(reads for _, reads in surface.inputs), *plain_images(surface.pattern)):
        if isinstance(reads, TextureInput) and reads.file.tiles:
            found.setdefault(reads.file, {}).setdefault((reads.st, reads.st_transform), reads)
    return {file: list(ways.values()) for file, ways in found.items()}


def _by_surface(description: SceneDescription) -> dict[int, list[Shape]]:
    found: dict[int, list[Shape]] = {}
    for shape in description.shapes:
        for number in [shape.surface] if isinstance(shape.surface, int) else np.unique(shape.surface).tolist():
            found.setdefault(number, []).append(shape)
    return found


def _coordinates(shape: Shape, surface: int, reads: TextureInput, per_instance: set[str]) -> Iterator[Triangles]:
    """Yield texture coordinates of the parts of a shape with a surface, some triangles at a time.

    A single point where they are the same everywhere.
    """
    primvar = next((p for p in shape.primvars if p.name == reads.st.name), None)
    if primvar is None or primvar.values.ndim != 2 or primvar.values.shape[1] < 2:
        if reads.st.name not in per_instance:
            yield np.tile(np.asarray(reads.st.fallback[:2], np.float64), (1, 3, 1))
        return
    if isinstance(shape, Curves | Ribbons):  # coordinates of control points or segment ends bound those in between
        for first in range(0, len(primvar.values), _AT_ONCE):
            yield np.repeat(primvar.values[first : first + _AT_ONCE, None, :2].astype(np.float64), 3, axis=1)
        return
    corners, face_of = _corners(shape)
    if isinstance(shape, Mesh | SubdivisionMesh) and not isinstance(shape.surface, int):
        chosen = shape.surface[face_of] == surface
        corners, face_of = corners[chosen], face_of[chosen]
    for first in range(0, len(corners), _AT_ONCE):
        part = corners[first : first + _AT_ONCE]
        match primvar.interpolation:
            case Interpolation.CORNER:
                rows = part if primvar.indices is None else primvar.indices[part]
            case Interpolation.POINT | Interpolation.VARYING if not isinstance(shape, Mesh):
                rows = shape.face_points[part] if isinstance(shape, SubdivisionMesh) else part
            case Interpolation.POINT:
                rows = shape.triangles.reshape(-1)[part] if isinstance(shape, Mesh) else part
            case Interpolation.FACE:
                rows = np.repeat(face_of[first : first + _AT_ONCE, None], 3, axis=1)
            case _:
                rows = np.zeros((1, 3), np.int32)
        yield primvar.values[rows][..., :2].astype(np.float64)


def _corners(shape: Shape) -> tuple[Ints, Ints]:
    """Return (K, 3) corners of triangles, numbered through the shape's faces, and (K,) their faces; polygons become fans."""
    if isinstance(shape, Mesh):
        count = len(shape.triangles)
        return np.arange(3 * count, dtype=np.int32).reshape(-1, 3), np.arange(count, dtype=np.int32)
    if not isinstance(shape, SubdivisionMesh):
        return np.zeros((1, 3), np.int32), np.zeros(1, np.int32)
    fans = shape.face_counts - 2
    face_of = np.repeat(np.arange(len(fans), dtype=np.int32), fans)
    starts = np.cumsum(shape.face_counts) - shape.face_counts
    within = np.arange(len(face_of)) - np.repeat(np.cumsum(fans) - fans, fans)
    first = starts[face_of]
    return np.stack([first, first + within + 1, first + within + 2], axis=1).astype(np.int32), face_of


def _transformed(st: Triangles, reads: TextureInput) -> Triangles:
    m = np.asarray(reads.st_transform, np.float64).reshape(2, 3)
    return st @ m[:, :2].T + m[:, 2]


def overlapped_tiles(triangles: Triangles, known: set[int]) -> set[int]:
    """Return the numbers of the tiles that triangles overlap by more than rounding; 0 for outside. `known` ones are skipped."""
    finite = triangles[np.isfinite(triangles).all(axis=(1, 2))]
    low = np.floor(finite.min(axis=1) + _NEAR)
    high = np.maximum(np.ceil(finite.max(axis=1) - _NEAR) - 1, low)
    found = {_OUTSIDE} if bool((low < 0).any() or (high >= ACROSS).any()) else set()
    low, high = np.clip(low, 0, ACROSS).astype(np.int64), np.clip(high, -1, ACROSS - 1).astype(np.int64)
    alone = (low == high).all(axis=1)
    found |= set((FIRST + low[alone] @ (1, ACROSS)).tolist())
    low, high, several = low[~alone], high[~alone], finite[~alone]
    for row in range(int(low[:, 1].min(initial=ACROSS)), int(high[:, 1].max(initial=-1)) + 1):
        for column in range(int(low[:, 0].min(initial=ACROSS)), int(high[:, 0].max(initial=-1)) + 1):
            tile = FIRST + column + ACROSS * row
            if tile in known or tile in found:
                continue
            near = ((low <= (column, row)) & (high >= (column, row))).all(axis=1)
            if _any_overlaps(several[near], np.array([column + 0.5, row + 0.5])):
                found.add(tile)
    return found


def _any_overlaps(triangles: Triangles, center: Floats | npt.NDArray[np.float64]) -> bool:
    """Return whether any triangle overlaps a tile that its bounding box overlaps: no edge separates the two."""
    relative = triangles - center
    edges = np.roll(relative, -1, axis=1) - relative
    normals = np.stack([-edges[..., 1], edges[..., 0]], axis=-1)  # (K, 3 edges, 2)
    along = np.einsum("kei,kci->kec", normals, relative)
    reach = (0.5 - _NEAR) * np.abs(normals).sum(axis=-1)
    apart = (along.min(axis=2) >= reach) | (along.max(axis=2) <= -reach)
    return bool((~apart.any(axis=1)).any())


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
                diagnostics.add("texture-outside", description.surfaces[number].path, _outside_message(name, reads))


def _outside_message(name: str, reads: TextureInput) -> str:
    default_wrap = Wrap.USE_METADATA in (reads.wrap_s, reads.wrap_t)
    why = "no wrap mode is set, which means black: use --default-wrap repeat" if default_wrap else "its wrap modes are black"
    name = name.removeprefix(OPEN_PBR_PREFIX)
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
