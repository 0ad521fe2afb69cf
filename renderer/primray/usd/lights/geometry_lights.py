"""GeometryLight (UsdLux, deprecated): in a copy of the stage, the geometry that it names gets its properties and LightAPI."""

from __future__ import annotations

from collections.abc import Container, Sequence

from pxr import Sdf, Usd, UsdGeom

from ...diagnostics import Diagnostics
from ..opening.reach import check_reach
from ..opening.stage import scratch_copy
from ..opening.taking_out import editable
from ..querying.guarded import property_names, purpose_of, schemas_applied, targets
from ..resolving.read import When, is_hidden
from ..resolving.renderer_attributes import LEFT_OUT

# Properties of the light prim itself, which its geometry does not get.
_ITS_OWN = ("xformOp", "visibility", "purpose", "geometry", "light:shaderId", "extent")


def with_geometry_lights(
    stage: Usd.Stage, lights: Sequence[Usd.Prim], purposes: Container[str], when: When, diagnostics: Diagnostics
) -> Usd.Stage:
    """Return a copy of the stage in which the geometry that GeometryLights name emits in their place.

    The GeometryLights are left out, but not their children. A GeometryLight that names no geometry stays and is reported like
    any unsupported light. `purposes` are those that are rendered.
    """
    made = scratch_copy(stage)
    lit: dict[Sdf.Path, Sdf.Path] = {}  # geometry, and which light it gives
    done: list[Sdf.Path] = []
    hidden = {light.GetPath(): _is_hidden(light, purposes, when) for light in lights}
    with Usd.EditContext(made, made.GetSessionLayer()):
        for path in hidden:
            light = editable(made, path)
            shapes = [target for target in targets(light, "geometry") if made.GetPrimAtPath(target)]
            for shape in [] if hidden[path] else shapes:  # by paths: ending an instance invalidates prims of others
                if lit.setdefault(shape, path) != path:
                    message = f"{shape} already emits as the geometry of {lit[shape]}: it does not emit this light as well."
                    diagnostics.add("light-input", str(path), message, "geometry")
                elif made.GetPrimAtPath(shape).IsA(UsdGeom.Gprim):
                    given = editable(made, shape)
                    _give(made.GetPrimAtPath(path), given)
                else:
                    message = f"geometry names {shape}, which is not geometry and cannot emit."
                    diagnostics.add("light-input", str(path), message, "geometry")
            if shapes:
                done.append(path)
        for path in done:  # after all geometry is lit: other lights may reference this one
            made.GetPrimAtPath(path).CreateAttribute(LEFT_OUT, Sdf.ValueTypeNames.Bool).Set(True)
    check_reach(made)
    return made


def _is_hidden(light: Usd.Prim, purposes: Container[str], when: When) -> bool:
    return is_hidden(light, when) or purpose_of(light) not in purposes or LEFT_OUT in property_names(light)


def _give(light: Usd.Prim, shape: Usd.Prim) -> None:
    for schema in ("LightAPI", *schemas_applied(light)):
        if schema not in schemas_applied(shape):
            shape.AddAppliedSchema(schema)
    for name in property_names(light):
        if not name.startswith(_ITS_OWN):
            light.GetProperty(name).FlattenTo(shape, name)
