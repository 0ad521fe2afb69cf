"""UsdRenderPass: the one that is asked for changes the scene before it is translated; what others say is for the software that
submits renders.

What `prune` holds is deactivated; geometry and lights that `renderVisibility` leaves out are not rendered, those that
`cameraVisibility` leaves out are not seen by the camera, and shapes that `matte` holds are holes in its picture. Members stay
whatever is above them: a parent that is left out is left out alone. All of it is written to a session layer of a copy of the
stage, so that everything after it sees an ordinary stage; instances that are told apart inside are instances no more there.
"""

from __future__ import annotations

from pxr import Kind, Sdf, Usd, UsdGeom, UsdLux

from ....description import CameraSight
from ....diagnostics import Diagnostics
from ....errors import SettingsError
from ...opening.reach import check_reach
from ...opening.stage import scratch_copy
from ...opening.taking_out import editable, take_out
from ...querying.guarded import computed, property_names, targets, type_name
from ...querying.model_marks import MODEL
from ...querying.traversal import collected, drawn, in_world, placed_elsewhere
from ...resolving.renderer_attributes import CAMERA_SIGHT, CAMERA_VISIBILITY, LEFT_OUT

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
    """A copy of the stage as the pass wants it rendered; OpinionsLeak where that would change other prims."""
    made = scratch_copy(stage)
    prim = render_pass(made, asked)
    _note_unread(prim, diagnostics)
    collections = {name: _members(prim, name, diagnostics) for name in COLLECTIONS}
    take_out(made, _drawn_members(made, collections["prune"]))
    with Usd.EditContext(made, made.GetSessionLayer()):
        _leave_out(made, collections["renderVisibility"])
        _hold_out(made, collections["matte"])
        _hide_from_camera(made, collections["cameraVisibility"])
    check_reach(made)
    return made


def _note_unread(prim: Usd.Prim, diagnostics: Diagnostics) -> None:
    path, authored = str(prim.GetPath()), property_names(prim)
    if "fileName" in authored:
        message = "fileName names another file's scene: this one's is rendered."
        diagnostics.add("render-settings-input", path, message, "fileName")
    if "inputPasses" in authored and targets(prim, "inputPasses"):
        message = "The passes that inputPasses names are not rendered first."
        diagnostics.add("render-settings-input", path, message, "inputPasses")


def _members(prim: Usd.Prim, name: str, diagnostics: Diagnostics) -> frozenset[Sdf.Path] | None:
    """Paths of prims, in instances those of their proxies; None where the collection says nothing but its default."""
    if not any(p.startswith(f"collection:{name}") for p in property_names(prim)):
        return None
    query = Usd.CollectionAPI(prim, name).ComputeMembershipQuery()
    members = collected(query, prim.GetStage())
    if name == "prune":  # an instancer that is pruned draws nothing
        return members
    as_instancers = _as_their_instancers(prim.GetStage(), members, query)
    added = {path for path, votes in as_instancers.items() if votes == {True}}
    differ = {path for path, votes in as_instancers.items() if len(votes) > 1}
    if name == "renderVisibility":  # an instancer that is left out draws nothing, whatever others draw
        added |= differ
    elif differ:
        message = f"Some of the point instancers that draw {min(differ)} are in {name}, some are not: they are drawn alike."
        diagnostics.add("render-settings-input", str(prim.GetPath()), message, f"collection:{name}")
    return (members - {path for path, votes in as_instancers.items() if votes == {False}}) | added


def _as_their_instancers(
    stage: Usd.Stage, members: frozenset[Sdf.Path], query: Usd.CollectionMembershipQuery
) -> dict[Sdf.Path, set[bool]]:
    """Whether the point instancers are members that draw prims elsewhere than below themselves, of prims that the collection
    itself says nothing of: its rules name neither them nor anything above them but the root of all."""
    rules = {path for path in query.GetAsPathExpansionRuleMap() if path != Sdf.Path.absoluteRootPath}
    found: dict[Sdf.Path, set[bool]] = {}
    for instancer, _, prims in placed_elsewhere(stage):
        at = instancer.GetPath()
        votes = found.get(at) or {at in members}
        for path in [prim.GetPath() for prim in prims if not prim.GetPath().HasPrefix(at)]:
            is_named = not rules.isdisjoint(path.GetPrefixes()) if rules else path in members
            if not is_named:
                found.setdefault(path, set()).update(votes)
    return found


def _drawn_members(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> list[Sdf.Path]:
    return [path for prim in drawn(stage) if (path := prim.GetPath()) in members] if members else []


def _leave_out(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    """Geometry and lights that are no members. Those with members below, which invisible ones would hide, are marked."""
    if members is None:
        return
    rendered = [prim.GetPath() for prim in drawn(stage) if _is_rendered(prim)]
    above = {prefix for path in rendered if path in members for prefix in path.GetPrefixes()}
    hidden = dict.fromkeys(_hidden_with(stage, path, above) for path in rendered if path not in members)
    for path in hidden:
        prim = editable(stage, path)
        if path in above and type_name(prim) == "PointInstancer":  # of its prototypes, those that are no members are left out
            continue
        if path in above or not prim.IsA(UsdGeom.Imageable):
            prim.CreateAttribute(LEFT_OUT, Sdf.ValueTypeNames.Bool).Set(True)
        else:
            UsdGeom.Imageable(prim).CreateVisibilityAttr("invisible")


def _hidden_with(stage: Usd.Stage, path: Sdf.Path, above: set[Sdf.Path]) -> Sdf.Path:
    """The outermost native instance around a prim that has no members below, so that it can stay an instance; or the prim."""
    prim = stage.GetPrimAtPath(path)
    if prim.IsInstanceProxy():
        for prefix in path.GetPrefixes()[:-1]:
            around = stage.GetPrimAtPath(prefix)
            if around.IsInstance() and prefix not in above and around.IsA(UsdGeom.Imageable):
                return prefix
    return path


def _is_rendered(prim: Usd.Prim) -> bool:
    """Geometry, lights and what filters them, and models that are drawn as cards or boxes."""
    if prim.IsA(UsdGeom.Boundable) or prim.HasAPI(UsdLux.LightAPI) or prim.IsA(UsdLux.LightFilter):
        return True
    if MODEL in property_names(prim):  # USD does not compute its mode any more; what is below has members or goes with it
        return True
    return _may_have_draw_mode(prim) and computed(UsdGeom.ModelAPI(prim).ComputeModelDrawMode, "default") != "default"


def _hold_out(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    if members is None:
        return
    for path in [prim.GetPath() for prim in drawn(stage) if prim.GetPath() in members and _is_shape(prim)]:
        _tell_camera(stage, path, CameraSight.MATTE)


def _hide_from_camera(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    """Shapes and lights that are no members."""
    if members is None:
        return
    left_out = [prim for prim in drawn(stage) if prim.GetPath() not in members]
    for path, is_shape, is_light in [(prim.GetPath(), _is_shape(prim), prim.HasAPI(UsdLux.LightAPI)) for prim in left_out]:
        if is_shape:
            _tell_camera(stage, path, CameraSight.HIDDEN)
        elif is_light:
            editable(stage, path).CreateAttribute(CAMERA_VISIBILITY[0], Sdf.ValueTypeNames.Bool).Set(False)


def _is_shape(prim: Usd.Prim) -> bool:
    """Or a model, which may be drawn as cards."""
    is_light = prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdGeom.Gprim)
    return _may_have_draw_mode(prim) or (bool(prim.IsA(UsdGeom.Boundable)) and not is_light)


def _may_have_draw_mode(prim: Usd.Prim) -> bool:
    if Usd.ModelAPI(prim).IsKind(Kind.Tokens.component):
        return True
    names = property_names(prim)
    return "model:applyDrawMode" in names or MODEL in names


def _tell_camera(stage: Usd.Stage, path: Sdf.Path, sight: CameraSight) -> None:
    editable(stage, path).CreateAttribute(CAMERA_SIGHT, Sdf.ValueTypeNames.Token).Set(sight.value)
