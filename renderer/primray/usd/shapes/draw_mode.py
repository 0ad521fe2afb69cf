"""Adapters for model:drawMode: textured cards, the edges of the bounding box, or the axes drawn instead of a model.

The rules are those of UsdGeomModelAPI (usdGeom's schema.usda). For the orientation of card textures its text disagrees with
OpenUSD's own imaging and with assets in use; we follow the imaging: upright when seen from outside, upside down for Z- (_ST
below). Lines have no width in a path tracer, so edges and axes are bars, with a thickness of BAR_WIDTH times the longest side
of the box or the unit axis.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from pxr import Kind, Sdf, Tf, Usd, UsdGeom

from ...arrays import Doubles
from ...description import Interpolation, Mesh, Primvar, PrimvarInput, Surface, TextureFile, TextureInput, Wrap
from ...textures.image_layout import read_matrix
from ..materials.appearance import camera_visibility
from ..materials.texture_files import in_space
from ..scene.bounds import is_deep
from ..scene.color_spaces import color_in_rendering_space
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.edits import MODEL, temporarily_defined
from ..stage.metadata import start_time_code, up_axis
from ..stage.open import scratch_copy
from ..stage.reads import read_asset
from ..stage.time_varying import EARLIEST, earliest_value
from ..stage.traversal import is_in_world, world_prims_in_instances
from ..stage.values import read, token, vector

BAR_WIDTH = 0.01
DEFAULT_COLOR = (0.18, 0.18, 0.18)  # fallback of model:drawModeColor
OPACITY_THRESHOLD = 0.1  # opacityThreshold that OpenUSD's imaging uses for cards
# Distance between the two cards of a cross, relative to the box. They are back to back, so that each is seen from its own side.
CROSS_GAP = 1e-4

FACES = ("XPos", "XNeg", "YPos", "YNeg", "ZPos", "ZNeg")
# Texture axes of each face: the box axes along which s and t run, and whether they run against it.
_ST = {
    "XPos": ((1, False), (2, False)),
    "XNeg": ((1, True), (2, False)),
    "YPos": ((0, True), (2, False)),
    "YNeg": ((0, False), (2, False)),
    "ZPos": ((0, False), (1, False)),
    "ZNeg": ((0, False), (1, True)),
}


def draw_mode_of(prim: ResolvedPrim, ctx: Context) -> str:
    """Return the draw mode that replaces this prim and its descendants, or "" if their geometry is drawn."""
    mode = prim.inherited.draw_mode
    if mode == "default" or not _applies(prim, ctx):
        return ""
    if mode not in DRAW_MODES:
        ctx.warn(
            "draw-mode-input", prim.path, f"model:drawMode = {mode!r} is not known; the geometry is drawn.", "model:drawMode"
        )
        return ""
    return mode


def _applies(prim: ResolvedPrim, ctx: Context) -> bool:
    """Return whether the draw mode applies: the prim is a model and either model:applyDrawMode is true, or it is not authored
    and the prim's kind is component."""
    if not (prim.prim.IsModel() or MODEL in prim.names):
        return False
    if "model:applyDrawMode" in prim.names:
        authored = read(prim.prim, "model:applyDrawMode", ctx.when)
        if isinstance(authored, bool):
            return authored
    return bool(Usd.ModelAPI(prim.prim).IsKind(Kind.Tokens.component, Usd.ModelAPI.KindValidationNone))


def origin(prim: ResolvedPrim, ctx: Context) -> Mesh | None:
    """Return the model's axes as unit-length bars."""
    ctx.warn("draw-mode", prim.path, f"Its axes are drawn, as bars {BAR_WIDTH:g} thick.")
    return _bars_along(prim, [(np.zeros(3), axis) for axis in np.eye(3)], BAR_WIDTH, ctx)


def bounds(prim: ResolvedPrim, ctx: Context) -> Mesh | None:
    """Return the edges of the model's bounding box as bars."""
    box = _box(prim, ctx)
    if box is None:
        return None
    edges = []
    for corner in itertools.product((0, 1), repeat=3):
        for axis in range(3):
            if corner[axis] == 0:
                ends = np.array([corner, corner])
                ends[1, axis] = 1
                edges.append((np.where(ends[0], box[1], box[0]), np.where(ends[1], box[1], box[0])))
    width = BAR_WIDTH * float((box[1] - box[0]).max())
    ctx.warn("draw-mode", prim.path, f"The edges of its bounds are drawn, as bars {width:g} thick.")
    return _bars_along(prim, edges, width, ctx) if width > 0 else None


def cards(prim: ResolvedPrim, ctx: Context) -> Mesh | None:
    geometry = token(prim.prim, "model:cardGeometry", ctx.when, "cross")
    found = _cards_from_textures(prim, ctx) if geometry == "fromTexture" else _cards_on_box(prim, geometry == "box", ctx)
    hidden = _hidden_axis(prim, ctx)
    found = [card for card in found if card.face[0] != hidden and _has_area(card.corners)]
    if not found:
        return None
    ctx.warn("draw-mode", prim.path, f"{len(found)} cards are drawn ({geometry}); they are seen from both sides.")
    quads = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(
        path=prim.path,
        points=np.concatenate([card.corners for card in found]).astype(np.float32),
        triangles=np.concatenate([quads + 4 * k for k in range(len(found))]),
        normals=None,
        colors=None,
        surface=np.repeat([ctx.surfaces.index_of(card.surface) for card in found], 2).astype(np.int32),
        primvars=(Primvar("st", Interpolation.POINT, np.concatenate([card.st for card in found]).astype(np.float32)),),
    )


DRAW_MODES = {"cards": cards, "bounds": bounds, "origin": origin}


@dataclass(frozen=True, eq=False)
class _Card:
    face: str
    corners: Doubles  # (4, 3), counter-clockwise seen from outside
    st: Doubles  # (4, 2)
    surface: Surface


def _cards_on_box(prim: ResolvedPrim, box_faces: bool, ctx: Context) -> list[_Card]:
    """Return cards on the faces of the model's box, or through its centre. Faces of an axis without a texture are left out if
    another axis has one."""
    box = _box(prim, ctx)
    if box is None:
        return []
    textures = {face: path for face in FACES if (path := _texture(prim, face, ctx)) is not None}
    made = []
    for k, face in enumerate(FACES):
        opposite = FACES[k ^ 1]
        source = face if face in textures else opposite
        if textures and source not in textures:
            continue
        unit = _unit_face(face, box_faces)
        st = np.stack([1 - unit[:, axis] if against else unit[:, axis] for axis, against in _ST[source]], axis=1)
        corners = box[0] + unit * (box[1] - box[0])
        made.append(_Card(face, corners, st, _surface(prim, textures.get(source), ctx)))
    return made


def _unit_face(face: str, box_faces: bool) -> Doubles:
    """Return the corners (4, 3) of a face of the unit box, or of the card through its centre, wound so that the outside is in
    front."""
    axis, positive = "XYZ".index(face[0]), face.endswith("Pos")
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners = np.empty((4, 3))
    corners[:, [u, v]] = [(0, 0), (1, 0), (1, 1), (0, 1)]
    gap = CROSS_GAP / 2 if positive else -CROSS_GAP / 2
    corners[:, axis] = float(positive) if box_faces else 0.5 + gap
    return corners if positive else corners[::-1].copy()


def _cards_from_textures(prim: ResolvedPrim, ctx: Context) -> list[_Card]:
    """Return cards placed by the worldtoscreen matrices in their textures' metadata: the quad (-1, -1, 0) to (1, 1, 0) of that
    clip space."""
    made = []
    quad = np.array([(-1, -1, 0, 1), (1, -1, 0, 1), (1, 1, 0, 1), (-1, 1, 0, 1)], np.float64)
    for face in FACES:
        path = _texture(prim, face, ctx)
        matrix = read_matrix(path, read_asset) if path else None
        if matrix is None or not np.isfinite(matrix).all() or np.linalg.det(matrix) == 0:
            if path is not None:
                ctx.warn(
                    "draw-mode-input", prim.path, f"{path or face} has no usable worldtoscreen matrix: its card is not drawn."
                )
            continue
        placed = quad @ np.linalg.inv(matrix)  # row vectors, as stored in the file
        if (placed[:, 3] != 0).all():
            made.append(_Card(face, placed[:, :3] / placed[:, 3:], (quad[:, :2] + 1) / 2, _surface(prim, path, ctx)))
    return made


def _texture(prim: ResolvedPrim, face: str, ctx: Context) -> str | None:
    """Return the resolved path of a face's texture: "" if the file is missing, None if no texture is authored."""
    asset = read(prim.prim, f"model:cardTexture{face}", ctx.when)
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return None
    if not asset.resolvedPath:
        message = f"The card's texture {asset.path} is missing: model:drawModeColor is used instead."
        ctx.warn("asset-missing", prim.path, message, f"model:cardTexture{face}")
    return str(asset.resolvedPath)


def _surface(prim: ResolvedPrim, path: str | None, ctx: Context) -> Surface:
    color = _color(prim, ctx)
    if not path:
        return Surface("", lambert=True, diffuse_color=color, camera=camera_visibility(prim, ctx))
    st, file = PrimvarInput("st", (0.0, 0.0)), in_space(TextureFile(path, "auto"), "auto", True, ctx)
    fallback = (*color, 1.0)
    rgb = TextureInput(file, "rgb", st, wrap_s=Wrap.CLAMP, wrap_t=Wrap.CLAMP, fallback=fallback)
    alpha = TextureInput(file, "a", st, wrap_s=Wrap.CLAMP, wrap_t=Wrap.CLAMP, fallback=fallback)
    inputs = (("diffuse_color", rgb), ("opacity", alpha))
    camera = camera_visibility(prim, ctx)
    return Surface(prim.path, diffuse_color=color, opacity_threshold=OPACITY_THRESHOLD, thin=True, inputs=inputs, camera=camera)


def _color(prim: ResolvedPrim, ctx: Context) -> tuple[float, float, float]:
    r, g, b = vector(prim.prim, "model:drawModeColor", ctx.when, DEFAULT_COLOR, ctx.diagnostics)
    attribute = prim.prim.GetAttribute("model:drawModeColor")
    return color_in_rendering_space((r, g, b), attribute, prim.inherited.colors, ctx) if attribute else (r, g, b)


def _hidden_axis(prim: ResolvedPrim, ctx: Context) -> str:
    """Return the stage's up axis if the nearest model:cardVisibility is simple, else ""."""
    return up_axis(ctx.stage) if prim.inherited.card_visibility == "simple" else ""


def _has_area(corners: Doubles) -> bool:
    return bool(np.cross(corners[1] - corners[0], corners[3] - corners[0]).any())


_PURPOSES = ("default", "render", "proxy")


def _box(prim: ResolvedPrim, ctx: Context) -> tuple[Doubles, Doubles] | None:
    """Return the model's bounds in its own space at its earliest time, over all purposes except guide: extentsHint if authored,
    else computed."""
    box = _extents_hint(prim.prim)
    if box is None:
        box = _computed_box(prim.prim) if is_in_world(prim.prim) else _box_outside_world(prim.prim, ctx)
    if box is None or not (np.isfinite(box).all() and (box[0] <= box[1]).all()):
        ctx.warn("draw-mode-input", prim.path, "The model has no bounds: nothing is drawn in its place.", "extentsHint")
        return None
    return box


def _box_outside_world(prim: Usd.Prim, ctx: Context) -> tuple[Doubles, Doubles] | None:
    """Return the bounds of a model below a `class` or `over` prim, for which USD computes none, from a copy of the stage where
    those prims are defined."""
    copies, path = ctx.caches.defined_copy, str(prim.GetPath())
    if not copies:
        copies.append(scratch_copy(ctx.stage))
    with temporarily_defined(copies[0], [path]):
        return _computed_box(copies[0].GetPrimAtPath(path))


def _computed_box(prim: Usd.Prim) -> tuple[Doubles, Doubles] | None:
    """Return the bounds computed by USD at the earliest time, or at the stage's start time if splines have no finite value
    before their first knot."""
    if not prim or is_deep(world_prims_in_instances(prim)):
        return None
    box = _box_at(prim, EARLIEST)
    is_finite = box is None or np.isfinite(box).all()
    return box if is_finite else _box_at(prim, Usd.TimeCode(start_time_code(prim.GetStage())))


def _box_at(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[Doubles, Doubles] | None:
    try:
        cache = UsdGeom.BBoxCache(time, list(_PURPOSES), useExtentsHint=True)
        found = cache.ComputeUntransformedBound(prim).ComputeAlignedRange()
    except Tf.ErrorException:
        return None
    return None if found.IsEmpty() else (np.array(found.GetMin()), np.array(found.GetMax()))


def _extents_hint(prim: Usd.Prim) -> tuple[Doubles, Doubles] | None:
    """Return the union of extentsHint's boxes for purposes default, render and proxy (two points per purpose; empty boxes are
    skipped)."""
    attribute = prim.GetAttribute("extentsHint")
    hint = earliest_value(attribute) if attribute else None
    try:
        pairs = np.asarray(hint, np.float64).reshape(-1, 2, 3)[: len(_PURPOSES)]
    except (TypeError, ValueError):
        return None
    pairs = pairs[(pairs[:, 0] <= pairs[:, 1]).all(axis=1)]
    return (pairs[:, 0].min(axis=0), pairs[:, 1].max(axis=0)) if len(pairs) else None


def _bars_along(prim: ResolvedPrim, lines: list[tuple[Doubles, Doubles]], width: float, ctx: Context) -> Mesh:
    """Return boxes around axis-aligned lines."""
    unit = np.array(list(itertools.product((0.0, 1.0), repeat=3)))[:, ::-1]  # x varies fastest
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    points = [low - width / 2 + unit * (high - low + width) for low, high in lines]
    return Mesh(
        path=prim.path,
        points=np.concatenate(points).astype(np.float32),
        triangles=np.concatenate([triangles + 8 * k for k in range(len(lines))]).astype(np.int32),
        normals=None,
        colors=None,
        surface=ctx.surfaces.index_of(
            Surface("", lambert=True, diffuse_color=_color(prim, ctx), camera=camera_visibility(prim, ctx))
        ),
    )
