"""Effects of a look beside material bindings: visibility and properties, written on the prims of the composed stage.

A MaterialX look may hide everything and show parts of it again, which USD's inheritance of visibility cannot express. So the
result is computed for each shape and light of the composed stage, and authored as an override in the look's variant. MaterialX
Geometry Extensions, "Visibility Elements", "Property Definition"; `twosided` has no effect, as surfaces are shaded on both
sides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf, Usd, UsdGeom, UsdLux

from ....description import CameraVisibility
from ...scene.schemas import CAMERA_VISIBILITY, SHAPE_VISIBILITY
from ...stage.traversal import EXISTING_IN_INSTANCES, children, world_prims_in_instances
from .document_marks import LOOK, NOTES
from .layer_writing import attribute, write_messages
from .look_assignments import Assignment, shares_of, strongest_assignment

_KNOWN = ("matte", "twosided")
_T = Sdf.ValueTypeNames


@dataclass
class LookEffects:
    """Assignments of a look, in order: visibility to everything, visibility to the camera, and mattes."""

    visible: list[Assignment] = field(default_factory=list)
    camera: list[Assignment] = field(default_factory=list)
    matte: list[Assignment] = field(default_factory=list)

    def __bool__(self) -> bool:
        """Return whether any assignment differs from every prim's default."""
        shown = all(assignment.what for assignment in (*self.visible, *self.camera))
        return not shown or any(assignment.what for assignment in self.matte)


def effects_of(looks: Sequence[Any], document: Any, wrong: list[str]) -> LookEffects:
    """Return the effects of looks, the last of which inherits the others; `wrong` receives messages about the rest."""
    made = LookEffects()
    for look in looks:
        for element in look.getVisibilities():
            _read_visibility(element, document, made, wrong)
        for element in look.getChildren():
            for name, value, target in _properties(element, document, wrong):
                if name == "matte" and not target:
                    made.matte.append(Assignment(value == "true", shares_of(element, document, wrong)))
                elif name not in _KNOWN and not target:
                    wrong.append(f"property {name} is not supported")
    if own := [child.getName() for child in document.getChildren() if child.getCategory() == "geominfo"]:
        wrong.append(f"geometric properties of geominfo {', '.join(own)} are not applied")
    return made


def _read_visibility(element: Any, document: Any, made: LookEffects, wrong: list[str]) -> None:
    kind, is_visible = element.getAttribute("vistype"), element.getAttribute("visible") != "false"
    viewers = element.getAttribute("viewergeom") or element.getAttribute("viewercollection")
    if kind not in ("", "camera") or viewers:
        if not is_visible:
            what = f"of the type {kind or 'all'}" + (f" to {viewers}" if viewers else "")
            wrong.append(f"visibility {element.getName()} {what} is not supported")
        return
    (made.camera if kind else made.visible).append(Assignment(is_visible, shares_of(element, document, wrong)))


def _properties(element: Any, document: Any, wrong: list[str]) -> list[tuple[str, str, str]]:
    """Return name, value and target of the properties that a child of a look assigns to geometry."""
    if element.getCategory() == "propertyassign":
        return [(element.getAttribute("property"), element.getAttribute("value"), element.getAttribute("target"))]
    if element.getCategory() != "propertysetassign":
        return []
    name = element.getAttribute("propertyset") or element.getAttribute("propertysetname")
    found = document.getPropertySet(name)
    if found is None:
        wrong.append(f"propertysetassign {element.getName()}: there is no propertyset {name}")
        return []
    own = [child for child in found.getChildren() if child.getCategory() == "property"]
    return [(child.getName(), child.getAttribute("value"), child.getAttribute("target")) for child in own]


def mark_looks(layer: Sdf.Layer, effects: Mapping[Sdf.Path, LookEffects]) -> None:
    """Mark the prims that choose a look with effects, so that they can be found on a stage."""
    for path in effects:
        attribute(layer.GetPrimAtPath(path), LOOK, _T.String, uniform=True).default = str(path)


def write_effects(stage: Usd.Stage, layers: Mapping[str, Mapping[Sdf.Path, LookEffects]]) -> None:
    """Author the effects of looks on the prims that they apply to; `layers`: effects by layer identifier."""
    found: list[tuple[Sdf.PrimSpec, LookEffects, Usd.Prim]] = []
    for prim in world_prims_in_instances(stage.GetPseudoRoot()):
        marked = prim.GetAttribute(LOOK) if prim.HasAttribute(LOOK) else None
        for spec in marked.GetPropertyStack() if marked else ():
            effects = layers.get(str(spec.layer.identifier), {}).get(Sdf.Path(str(spec.default)))
            if effects is not None:
                found.append((spec.layer.GetPrimAtPath(spec.default), effects, prim))
                break
    opinions = [opinion for variant, effects, prim in found for opinion in _opinions(variant, effects, prim)]
    with Sdf.ChangeBlock():
        for variant, path, name, kind, value in opinions:
            attribute(_over(variant, path), name, kind).default = value


def _is_in_instance(prim: Usd.Prim, model: Usd.Prim) -> bool:
    """Return whether the prim is in an instance below the model, so that USD ignores overrides of it."""
    above = prim.GetParent()
    while above and above != model:
        if above.IsInstance():
            return True
        above = above.GetParent()
    return False


_Opinion = tuple[Sdf.PrimSpec, Sdf.Path, str, Sdf.ValueTypeName, Any]


def _opinions(variant: Sdf.PrimSpec, effects: LookEffects, model: Usd.Prim) -> Iterator[_Opinion]:
    """Yield the opinions to author for a model's shapes and lights, by their paths below it."""
    for prim in world_prims_in_instances(model):
        is_light = prim.HasAPI(UsdLux.LightAPI)
        if not (is_light or prim.IsA(UsdGeom.Boundable)):
            continue
        path = prim.GetPath().MakeRelativePath(model.GetPath())
        levels = [] if prim == model else [part.name for part in path.GetPrefixes()]
        is_leaf = not any(child.IsA(UsdGeom.Imageable) for child in children(prim, EXISTING_IN_INSTANCES))

        def holds(of: list[Assignment], default: bool, at: Sequence[str] = levels, leaf: bool = is_leaf) -> bool:
            found = strongest_assignment(of, at, is_leaf=leaf)
            return default if found is None else bool(found.what)

        is_visible = holds(effects.visible, True)
        opinions = _of_camera(variant, path, holds, effects, is_light)
        if not is_visible:
            opinions = [(variant, path, "visibility", _T.Token, "invisible")]
        if opinions and _is_in_instance(prim, model):
            said = variant.attributes.get(NOTES)
            lines = list(said.default) if said else []
            write_messages(variant, [*lines, f"Its look has no effect on {path}, which is in an instance below the model."])
        else:
            yield from opinions


def _of_camera(
    variant: Sdf.PrimSpec, path: Sdf.Path, holds: Callable[[list[Assignment], bool], bool], effects: LookEffects, is_light: bool
) -> list[_Opinion]:
    """Return the opinions about the camera's view of a shape or light."""
    is_seen = holds(effects.camera, True)
    if is_light:
        return [] if is_seen else [(variant, path, CAMERA_VISIBILITY[0], _T.Bool, False)]
    visibility = CameraVisibility.SEEN if is_seen else CameraVisibility.HIDDEN
    if is_seen and holds(effects.matte, False):
        visibility = CameraVisibility.MATTE
    return [] if visibility is CameraVisibility.SEEN else [(variant, path, SHAPE_VISIBILITY, _T.Token, visibility.value)]


def _over(variant: Sdf.PrimSpec, path: Sdf.Path) -> Sdf.PrimSpec:
    """Return the prim spec at a path below a variant's, created if it does not exist."""
    spec = variant
    for part in path.GetPrefixes() if path != Sdf.Path.reflexiveRelativePath else ():
        spec = spec.nameChildren.get(part.name) or Sdf.PrimSpec(spec, part.name, Sdf.SpecifierOver)
    return spec
