"""UsdRenderPass: the requested pass edits a copy of the stage before it is translated; other passes concern render submission.

Members of `prune` are deactivated; geometry and lights that are no members of `renderVisibility` are not rendered, those that
are no members of `cameraVisibility` are hidden from the camera, and members of `matte` are holdouts. A member is rendered
whatever its ancestors are: a parent that is left out is left out alone. The edits are in the session layer of a copy of the
stage, so that all later code sees an ordinary stage; instances whose prims differ in membership are expanded there.
"""

from __future__ import annotations

from pxr import Kind, Sdf, Usd, UsdGeom, UsdLux

from ...description import CameraVisibility
from ...diagnostics import Diagnostics
from ...errors import SettingsError
from ..scene.schemas import CAMERA_VISIBILITY, LEFT_OUT, SHAPE_VISIBILITY
from ..stage.edits import MODEL, check_reach, deactivate, editable
from ..stage.open import scratch_copy
from ..stage.reads import computed, property_names, targets, type_name
from ..stage.traversal import collection_members, drawable_prims, prototypes_outside_world, world_prims

SUBMISSION_PROPERTIES = ("passType", "command", "renderSource", "inputPasses", "fileName")
COLLECTIONS = ("renderVisibility", "cameraVisibility", "prune", "matte")
LISTED_PASSES = 20


def report_ignored_render_pass(prim: Usd.Prim, diagnostics: Diagnostics) -> None:
    """Report a pass that is not requested, and each property it authors that could have changed the image."""
    path, authored = str(prim.GetPath()), property_names(prim)
    diagnostics.add("render-settings-input", path, "The render pass is ignored, as it is not requested (--render-pass).")
    for name in SUBMISSION_PROPERTIES:
        if name in authored:
            diagnostics.add("render-settings-input", path, f"{name} of a render pass is ignored.", name)
    for collection in COLLECTIONS:
        for name in authored:
            if name.startswith(f"collection:{collection}:"):
                message = f"{collection} of a render pass that is not requested is ignored: the whole scene is rendered."
                diagnostics.add("render-settings-input", path, message, name)


def find_render_pass(stage: Usd.Stage, asked: str) -> Usd.Prim:
    """Return the RenderPass at this path; SettingsError if there is none."""
    is_path = Sdf.Path.IsValidPathString(asked) and Sdf.Path(asked).IsAbsolutePath()
    prim = stage.GetPrimAtPath(asked) if is_path else None
    if prim and type_name(prim) == "RenderPass":
        return prim
    found = [str(p.GetPath()) for p in world_prims(stage) if type_name(p) == "RenderPass"]
    listed = ", ".join(found[:LISTED_PASSES]) or "none"
    raise SettingsError(f"There is no RenderPass {asked}; the stage's: {listed}.", where=asked, code="unknown-render-pass")


def settings_of_pass(stage: Usd.Stage, asked: str) -> str | None:
    """Return the path of the RenderSettings that the pass names as its renderSource; None if it names none of the stage."""
    for target in targets(find_render_pass(stage, asked), "renderSource"):
        prim = stage.GetPrimAtPath(target)
        if prim and type_name(prim) == "RenderSettings":
            return str(target)
    return None


def with_render_pass(stage: Usd.Stage, asked: str, diagnostics: Diagnostics) -> Usd.Stage:
    """Return a copy of the stage with the pass's edits; OpinionsLeak if they would change other prims."""
    made = scratch_copy(stage)
    prim = find_render_pass(made, asked)
    _note_unread(prim, diagnostics)
    collections = {name: _members(prim, name, diagnostics) for name in COLLECTIONS}
    deactivate(made, _drawn_members(made, collections["prune"]))
    with Usd.EditContext(made, made.GetSessionLayer()):
        _leave_out(made, collections["renderVisibility"])
        _hold_out(made, collections["matte"])
        _hide_from_camera(made, collections["cameraVisibility"])
    check_reach(made)
    return made


def _note_unread(prim: Usd.Prim, diagnostics: Diagnostics) -> None:
    path, authored = str(prim.GetPath()), property_names(prim)
    if "fileName" in authored:
        message = "fileName is ignored: the scene of this stage is rendered."
        diagnostics.add("render-settings-input", path, message, "fileName")
    if "inputPasses" in authored and targets(prim, "inputPasses"):
        message = "inputPasses is ignored: render these passes before this one."
        diagnostics.add("render-settings-input", path, message, "inputPasses")


def _members(prim: Usd.Prim, name: str, diagnostics: Diagnostics) -> frozenset[Sdf.Path] | None:
    """Return the paths of members (proxies for prims in instances); None if the collection is not authored."""
    if not any(p.startswith(f"collection:{name}") for p in property_names(prim)):
        return None
    query = Usd.CollectionAPI(prim, name).ComputeMembershipQuery()
    members = collection_members(query, prim.GetStage())
    if name == "prune":  # a pruned instancer draws nothing
        return members
    as_instancers = _instancer_membership(prim.GetStage(), members, query)
    added = {path for path, votes in as_instancers.items() if votes == {True}}
    differ = {path for path, votes in as_instancers.items() if len(votes) > 1}
    if name == "renderVisibility":  # other instancers of the same prototype still draw it
        added |= differ
    elif differ:
        message = (
            f"Only some of the point instancers that place {min(differ)} are in {name}: it is rendered alike in all of them."
        )
        diagnostics.add("render-settings-input", str(prim.GetPath()), message, f"collection:{name}")
    return (members - {path for path, votes in as_instancers.items() if votes == {False}}) | added


def _instancer_membership(
    stage: Usd.Stage, members: frozenset[Sdf.Path], query: Usd.CollectionMembershipQuery
) -> dict[Sdf.Path, set[bool]]:
    """Return whether the instancers of prototypes outside of them are members, for prims that no rule of the collection names.

    A rule names a prim if it is for its path or an ancestor's other than the root.
    """
    rules = {path for path in query.GetAsPathExpansionRuleMap() if path != Sdf.Path.absoluteRootPath}
    found: dict[Sdf.Path, set[bool]] = {}
    for instancer, _, prims in prototypes_outside_world(stage):
        at = instancer.GetPath()
        votes = found.get(at) or {at in members}
        for path in [prim.GetPath() for prim in prims if not prim.GetPath().HasPrefix(at)]:
            is_named = not rules.isdisjoint(path.GetPrefixes()) if rules else path in members
            if not is_named:
                found.setdefault(path, set()).update(votes)
    return found


def _drawn_members(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> list[Sdf.Path]:
    return [path for prim in drawable_prims(stage) if (path := prim.GetPath()) in members] if members else []


def _leave_out(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    """Hide geometry and lights that are no members; those with members below are marked instead, as hiding is inherited."""
    if members is None:
        return
    rendered = [prim.GetPath() for prim in drawable_prims(stage) if _is_rendered(prim)]
    above = {prefix for path in rendered if path in members for prefix in path.GetPrefixes()}
    hidden = dict.fromkeys(_prim_to_hide(stage, path, above) for path in rendered if path not in members)
    for path in hidden:
        prim = editable(stage, path)
        if path in above and type_name(prim) == "PointInstancer":  # prototypes that are no members are left out one by one
            continue
        if path in above or not prim.IsA(UsdGeom.Imageable):
            prim.CreateAttribute(LEFT_OUT, Sdf.ValueTypeNames.Bool).Set(True)
        else:
            UsdGeom.Imageable(prim).CreateVisibilityAttr("invisible")


def _prim_to_hide(stage: Usd.Stage, path: Sdf.Path, above: set[Sdf.Path]) -> Sdf.Path:
    """Return the outermost native instance around a prim that has no members below (it stays an instance); else the prim."""
    prim = stage.GetPrimAtPath(path)
    if prim.IsInstanceProxy():
        for prefix in path.GetPrefixes()[:-1]:
            around = stage.GetPrimAtPath(prefix)
            if around.IsInstance() and prefix not in above and around.IsA(UsdGeom.Imageable):
                return prefix
    return path


def _is_rendered(prim: Usd.Prim) -> bool:
    """Return whether a prim is geometry, a light or light filter, or a model drawn as cards or a box."""
    if prim.IsA(UsdGeom.Boundable) or prim.HasAPI(UsdLux.LightAPI) or prim.IsA(UsdLux.LightFilter):
        return True
    if MODEL in property_names(prim):  # already translated: USD does not compute its draw mode any more
        return True
    return _may_have_draw_mode(prim) and computed(UsdGeom.ModelAPI(prim).ComputeModelDrawMode, "default") != "default"


def _hold_out(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    if members is None:
        return
    for path in [prim.GetPath() for prim in drawable_prims(stage) if prim.GetPath() in members and _is_shape(prim)]:
        _set_camera_visibility(stage, path, CameraVisibility.MATTE)


def _hide_from_camera(stage: Usd.Stage, members: frozenset[Sdf.Path] | None) -> None:
    """Hide shapes and lights that are no members from the camera."""
    if members is None:
        return
    left_out = [prim for prim in drawable_prims(stage) if prim.GetPath() not in members]
    for path, is_shape, is_light in [(prim.GetPath(), _is_shape(prim), prim.HasAPI(UsdLux.LightAPI)) for prim in left_out]:
        if is_shape:
            _set_camera_visibility(stage, path, CameraVisibility.HIDDEN)
        elif is_light:
            editable(stage, path).CreateAttribute(CAMERA_VISIBILITY[0], Sdf.ValueTypeNames.Bool).Set(False)


def _is_shape(prim: Usd.Prim) -> bool:
    """Return whether a prim is a shape, or a model that may be drawn as cards."""
    is_light = prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdGeom.Gprim)
    return _may_have_draw_mode(prim) or (bool(prim.IsA(UsdGeom.Boundable)) and not is_light)


def _may_have_draw_mode(prim: Usd.Prim) -> bool:
    if Usd.ModelAPI(prim).IsKind(Kind.Tokens.component):
        return True
    names = property_names(prim)
    return "model:applyDrawMode" in names or MODEL in names


def _set_camera_visibility(stage: Usd.Stage, path: Sdf.Path, visibility: CameraVisibility) -> None:
    editable(stage, path).CreateAttribute(SHAPE_VISIBILITY, Sdf.ValueTypeNames.Token).Set(visibility.value)
