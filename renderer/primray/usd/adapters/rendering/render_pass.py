"""UsdRenderPass: the one that is asked for changes the scene before it is translated; what others say is for the software that
submits renders.

What `prune` holds is deactivated; geometry and lights that `renderVisibility` leaves out are invisible, those that
`cameraVisibility` leaves out are not seen by the camera, and shapes that `matte` holds are holes in its picture. All of it is
written to a session layer of a copy of the stage, so that everything after it sees an ordinary stage; instances that are told
apart inside are instances no more there.
"""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Kind, Sdf, Usd, UsdGeom, UsdLux

from ....description import CameraSight
from ....diagnostics import Diagnostics
from ....errors import SettingsError
from ...opening.stage import scratch_copy
from ...opening.taking_out import editable, take_out
from ...querying.guarded import default_value, property_names, targets, type_name
from ...querying.traversal import collected, drawn_in_instances, in_world
from ...resolving.renderer_attributes import CAMERA_SIGHT, CAMERA_VISIBILITY

ABOUT_JOBS = ("passType", "command", "renderSource", "inputPasses", "fileName")
COLLECTIONS = ("renderVisibility", "cameraVisibility", "prune", "matte")
LISTED = 20


def note_render_pass(prim: Usd.Prim, diagnostics: Diagnostics) -> None:
    """Of one that is not asked for: the pass itself, and whatever it authors, since each could have changed the picture."""
    path, authored = str(prim.GetPath()), property_names(prim)
    diagnostics.add("render-settings-input", path, "Render passes are ignored where none is asked for (--render-pass).")
    for name in ABOUT_JOBS:
        if name in authored:
            diagnostics.add("render-settings-input", path, f"{name} of a render pass is ignored.", name)
    for collection in COLLECTIONS:
        for name in authored:
            if name.startswith(f"collection:{collection}:"):
                message = f"The scene is rendered whole, whatever a render pass says of {collection}."
                diagnostics.add("render-settings-input", path, message, name)


def render_pass(stage: Usd.Stage, asked: str) -> Usd.Prim:
    """SettingsError where there is none of this path."""
    is_path = Sdf.Path.IsValidPathString(asked) and Sdf.Path(asked).IsAbsolutePath()
    prim = stage.GetPrimAtPath(asked) if is_path else None
    if prim and type_name(prim) == "RenderPass":
        return prim
    found = [str(p.GetPath()) for p in in_world(stage) if type_name(p) == "RenderPass"]
    listed = ", ".join(found[:LISTED]) or "none"
    raise SettingsError(f"There is no RenderPass {asked}; the stage's: {listed}.", where=asked, code="unknown-render-pass")


def settings_of_pass(stage: Usd.Stage, asked: str) -> str | None:
    """The RenderSettings that it renders from, if it names any of the stage."""
    for target in targets(render_pass(stage, asked), "renderSource"):
        prim = stage.GetPrimAtPath(target)
        if prim and type_name(prim) == "RenderSettings":
            return str(target)
    return None


def with_render_pass(stage: Usd.Stage, asked: str, diagnostics: Diagnostics) -> Usd.Stage:
    """A copy of the stage as the pass wants it rendered."""
    made = scratch_copy(stage)
    prim = render_pass(made, asked)
    _note_unread(prim, diagnostics)
    collections = {name: _members(prim, name) for name in COLLECTIONS}
    take_out(made, collections["prune"] or ())
    with Usd.EditContext(made, made.GetSessionLayer()):
        _hide(made, collections["renderVisibility"])
        _hold_out(made, collections["matte"])
        _hide_from_camera(made, collections["cameraVisibility"])
    return made


def _note_unread(prim: Usd.Prim, diagnostics: Diagnostics) -> None:
    path, authored = str(prim.GetPath()), property_names(prim)
    if "fileName" in authored:
        message = "fileName names another file's scene: this one's is rendered."
        diagnostics.add("render-settings-input", path, message, "fileName")
    if "inputPasses" in authored and targets(prim, "inputPasses"):
        message = "The passes that inputPasses names are not rendered first."
        diagnostics.add("render-settings-input", path, message, "inputPasses")


def _members(prim: Usd.Prim, name: str) -> frozenset[Sdf.Path] | None:
    """Paths of prims, in instances those of their proxies; None where the collection says nothing but its default."""
    if not any(p.startswith(f"collection:{name}") for p in property_names(prim)):
        return None
    return collected(Usd.CollectionAPI(prim, name).ComputeMembershipQuery(), prim.GetStage())


def _all(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    return iter(list(drawn_in_instances(stage.GetPseudoRoot())))


def _hide(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    """Geometry and lights that are no members; nothing that lies between."""
    if members is None:
        return
    rendered = {prim.GetPath(): _visibility(prim) for prim in _all(stage) if _is_rendered(prim)}
    for path in rendered:
        if path not in members:
            UsdGeom.Imageable(editable(stage, path)).CreateVisibilityAttr("invisible")
    for path, before in rendered.items():  # what refers to a prim that is hidden is not, if it is a member
        hidden = _visibility(stage.GetPrimAtPath(path)) == "invisible"
        if path in members and hidden and before != "invisible":
            UsdGeom.Imageable(editable(stage, path)).CreateVisibilityAttr(before or "inherited")


def _visibility(prim: Usd.Prim) -> str:
    return str(default_value(UsdGeom.Imageable(prim).GetVisibilityAttr()) or "")


def _is_rendered(prim: Usd.Prim) -> bool:
    return bool(prim.IsA(UsdGeom.Boundable) or prim.HasAPI(UsdLux.LightAPI)) and bool(prim.IsA(UsdGeom.Imageable))


def _hold_out(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    if members is None:
        return
    for path in [prim.GetPath() for prim in _all(stage) if prim.GetPath() in members and _is_shape(prim)]:
        _tell_camera(stage, path, CameraSight.MATTE)


def _hide_from_camera(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    """Shapes and lights that are no members."""
    if members is None:
        return
    left_out = [prim for prim in _all(stage) if prim.GetPath() not in members]
    for path, is_shape, is_rendered in [(prim.GetPath(), _is_shape(prim), _is_rendered(prim)) for prim in left_out]:
        if is_shape:
            _tell_camera(stage, path, CameraSight.HIDDEN)
        elif is_rendered:
            editable(stage, path).CreateAttribute(CAMERA_VISIBILITY[0], Sdf.ValueTypeNames.Bool).Set(False)


def _is_shape(prim: Usd.Prim) -> bool:
    """Or a model, which may be drawn as cards."""
    if Usd.ModelAPI(prim).IsKind(Kind.Tokens.component) or "model:applyDrawMode" in property_names(prim):
        return True
    return bool(prim.IsA(UsdGeom.Boundable)) and not (prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdGeom.Gprim))


def _tell_camera(stage: Usd.Stage, path: Sdf.Path, sight: CameraSight) -> None:
    editable(stage, path).CreateAttribute(CAMERA_SIGHT, Sdf.ValueTypeNames.Token).Set(sight.value)
