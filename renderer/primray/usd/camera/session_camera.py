"""Free camera of an interactive session: one prim of the session layer, which is in memory and the strongest layer.

It has the lens of another camera at any position, and moving it changes one attribute.
"""

from __future__ import annotations

from pxr import Gf, Sdf, Usd, UsdGeom

from ...arrays import Doubles
from ...description import Camera, Projection
from ..stage.reads import type_name
from ..stage.time_varying import earliest_value
from ..stage.traversal import all_children
from .camera import NEAREST, UNCLIPPED

PATH = "/primray_view"
_FOCAL_MM = 50.0
_MM_PER_UNIT = 10.0  # apertures of orthographic cameras are in tenths of scene units
_FILM = ("horizontalAperture", "verticalAperture", "horizontalApertureOffset", "verticalApertureOffset")
_OP = "xformOp:transform:primrayView"


def place_camera(stage: Usd.Stage, world_from_camera: Doubles, like: Camera, zoom: float = 1.0, nearest: float = 0.0) -> str:
    """Place the session camera and return its path; it has the lens of `like`, with a film `zoom` times as large.

    `like` is a camera of the stage, which keeps deciding about all but the placement, or one that was made (its path is "").
    `nearest`: as in Camera.
    """
    prim = stage.GetPrimAtPath(PATH)
    if not prim or prim.GetCustomDataByKey("like") != like.path:
        prim = _define_camera(stage, like)
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        prim.GetAttribute(_OP).Set(Gf.Matrix4d(world_from_camera.T.tolist()))
        prim.GetAttribute(NEAREST).Set(nearest)
        if zoom != 1.0 or prim.GetCustomDataByKey("zoomed"):
            _zoom(prim, like, zoom)
    return PATH


def is_session_camera(path: str) -> bool:
    return path == PATH


def is_of_session_camera(path: Sdf.Path) -> bool:
    """Return whether the path is of the session camera, one of its properties, or a prim below it."""
    return bool(path.HasPrefix(PATH))


# An attribute that any new session camera has, by which its making is told as a change.
PLACEMENT = Sdf.Path(PATH).AppendProperty(_OP)


def has_camera(stage: Usd.Stage, path: str) -> bool:
    prim = stage.GetPrimAtPath(path)
    return bool(prim) and type_name(prim) == "Camera"


def _define_camera(stage: Usd.Stage, like: Camera) -> Usd.Prim:
    mask = stage.GetPopulationMask()
    if mask != Usd.StagePopulationMask.All() and not mask.Includes(PATH):
        stage.SetPopulationMask(mask.Add(PATH))
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.RemovePrim(PATH)
        prim = stage.DefinePrim(PATH, "Camera")
        prim.SetCustomDataByKey("like", like.path)
        prim.CreateAttribute(_OP, Sdf.ValueTypeNames.Matrix4d)
        prim.CreateAttribute(NEAREST, Sdf.ValueTypeNames.Double)
        UsdGeom.Xformable(prim).CreateXformOpOrderAttr().Set(["!resetXformStack!", _OP])
        if like.path:
            prim.GetReferences().AddInternalReference(like.path)
            for child in all_children(stage.GetPrimAtPath(like.path)):  # children of the camera exist already at its own place
                stage.OverridePrim(f"{PATH}/{child.GetName()}").SetActive(False)
        else:
            _write_lens(UsdGeom.Camera(prim), like)
    return prim


def _write_lens(camera: UsdGeom.Camera, like: Camera) -> None:
    left, right, bottom, top = like.window
    orthographic = like.projection is Projection.ORTHOGRAPHIC
    scale = _MM_PER_UNIT if orthographic else _FOCAL_MM
    camera.CreateProjectionAttr().Set("orthographic" if orthographic else "perspective")
    camera.CreateFocalLengthAttr().Set(_FOCAL_MM)
    camera.CreateHorizontalApertureAttr().Set((right - left) * scale)
    camera.CreateVerticalApertureAttr().Set((top - bottom) * scale)
    camera.CreateHorizontalApertureOffsetAttr().Set((left + right) / 2 * scale)
    camera.CreateVerticalApertureOffsetAttr().Set((bottom + top) / 2 * scale)
    camera.CreateClippingRangeAttr().Set(Gf.Vec2f(*UNCLIPPED))


def _zoom(prim: Usd.Prim, like: Camera, zoom: float) -> None:
    stage = prim.GetStage()
    for name in _FILM:
        if prim.GetCustomDataByKey(name) is None:
            of = stage.GetPrimAtPath(like.path) if like.path else prim
            prim.SetCustomDataByKey(name, float(earliest_value(of.GetAttribute(name))))
        prim.GetAttribute(name).Set(prim.GetCustomDataByKey(name) * zoom)
    prim.SetCustomDataByKey("zoomed", True)


def camera_layer(stage: Usd.Stage, sublayer: str | None = None) -> str:
    """Return the session camera as the text of a layer, to be laid over the stage; `sublayer`: a weaker one beside it."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CopySpec(stage.GetSessionLayer(), PATH, layer, PATH)
    layer.GetPrimAtPath(PATH).ClearInfo("customData")
    if sublayer is not None:
        layer.subLayerPaths.append(sublayer)
    text: str = layer.ExportToString()
    return text
