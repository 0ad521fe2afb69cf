"""Diagnostics about a prim itself: what it has authored that the picture will not show.

Only what any prim may carry is noted here; adapters report what is special to the prims that they read.
"""

from __future__ import annotations

from functools import cache

from pxr import Usd, UsdGeom

from ..querying.document_marks import NOTES
from ..querying.skin_marks import WEIGHTS, has_weights, why_unposed
from .applied_schemas import IGNORED, PHOTOMETRIC, PHYSICAL, UNDERSTOOD, applied_schemas, foreign_schema, is_without_effect
from .context import Context
from .foreign_names import note_light_inputs
from .read import read
from .renderer_attributes import LEFT_OUT
from .resolve import ResolvedPrim, is_drawn

_GEOMETRY = "Volume ParticleField ParticleField3DGaussianSplat GenerativeProcedural"
UNSUPPORTED = frozenset(_GEOMETRY.split())
_LIGHTS = "GeometryLight PluginLight LightFilter PluginLightFilter"
UNSUPPORTED_LIGHTS = frozenset(_LIGHTS.split())

_LIGHT_SCHEMAS = {"LightAPI", "MeshLightAPI", "VolumeLightAPI"}
_TYPES_NOTED = UNSUPPORTED | UNSUPPORTED_LIGHTS | {"PortalLight"}
_UNLIT = frozenset({"Points", "BasisCurves", "HermiteCurves", "NurbsCurves"})
_DRAWN_OTHERWISE = frozenset({"PointInstancer", "Points", "SkelRoot", "Skeleton"})
# Inputs that any light has, but which do nothing on a portal: it only guides a dome's samples.
_UNUSED_BY_PORTALS = ("inputs:intensity", "inputs:exposure", "inputs:color", "inputs:normalize",
                      "inputs:enableColorTemperature", "inputs:diffuse", "inputs:specular")  # fmt: skip
# UsdGeom MotionAPI: attribute -> the value that changes nothing.
_MOTION = {"motion:velocityScale": 1.0}


class LevelsMet(Exception):
    """Raised when the walk finds a root of levels of detail before a level has been chosen (walking/levels.py)."""


class LightShapes(set[str]):
    """Paths of shapes that LightAPI makes lights."""


class PhysicalSchemas(dict[str, set[str]]):
    """Applied schemas of the proposal "physical-lighting", by prim path."""


class PortalsMet(list[str]):
    """Paths of PortalLights."""


def is_noted(prim: Usd.Prim, type_name: str, schemas: list[str], properties: frozenset[str], kind: str) -> bool:
    """Return whether `note_prim` may report anything for prims of this type with these schemas, of which `prim` is one."""
    names = {schema.split(":")[0] for schema in schemas}
    is_light = kind == "light" or bool(names & _LIGHT_SCHEMAS)
    if (
        is_light
        or WEIGHTS in properties
        or NOTES in properties
        or "MotionAPI" in names
        or "LODRootAPI" in names
        or names & PHYSICAL
        or any(map(_is_unread, names))
    ):
        return True
    return (
        not kind and bool(type_name) and (type_name in _TYPES_NOTED or prim.IsA(UsdGeom.Boundable) or not _is_known(type_name))
    )


def note_prim(prim: ResolvedPrim, applied: list[str], kind: str, ctx: Context) -> None:
    """Report what the picture lacks of one prim, given its applied schemas; `kind` is "" for types without an adapter."""
    schemas = [schema.split(":")[0] for schema in applied]
    if "LODRootAPI" in schemas and not ctx.levels_chosen:
        raise LevelsMet(prim.path)
    if LEFT_OUT in prim.names:
        return
    if schemas:
        _note_schemas(prim, schemas, kind, ctx)
    if kind == "light" or "LightAPI" in schemas:
        note_light_inputs(prim, applied, ctx)
    if NOTES in prim.names:
        note_document(prim.prim, prim.path, ctx)
    if WEIGHTS in prim.names:
        _note_weights(prim, schemas, ctx)
    if not kind and prim.type_name:
        _note_type(prim, ctx)


def note_unknown_schemas(prim: Usd.Prim, path: str, ctx: Context) -> None:
    """Report unread schemas of a prim that the walk does not visit: a shader."""
    for schema in filter(_is_unread, {schema.split(":")[0] for schema in applied_schemas(prim)}):
        _note_unread(schema, path, ctx)


def note_document(prim: Usd.Prim, path: str, ctx: Context) -> None:
    """Report the parts of a prim's MaterialX document that have no effect: materialx/writing.py leaves them on the prim."""
    for line in read(prim, NOTES, ctx.when) or ():
        ctx.warn("materialx-part", path, str(line))


def _is_unread(schema: str) -> bool:
    """Return whether a schema may change the picture and is not read; harmless ones of other programs are reported by
    family."""
    return schema not in UNDERSTOOD and not is_without_effect(schema)


def _note_unread(schema: str, path: str, ctx: Context) -> None:
    foreign = foreign_schema(schema)
    instead = IGNORED.get(schema) or (foreign.meaning if foreign else "")
    message = f"{schema}: {instead}" if instead else f"{schema} is unknown: any effect on the picture is ignored."
    ctx.warn("api-schema", path, message)


def _note_weights(prim: ResolvedPrim, schemas: list[str], ctx: Context) -> None:
    if is_drawn(prim.inherited, ctx.purposes) and has_weights(prim.prim):
        reason = why_unposed(prim.prim, ctx.stage.GetPrimAtPath(prim.path), schemas)
        if reason:
            ctx.warn("skinning", prim.path, f"It has joint weights and is not posed: {reason}.", WEIGHTS)


def _note_type(prim: ResolvedPrim, ctx: Context) -> None:
    if prim.type_name == "PortalLight":
        _note_portal(prim, ctx)
    elif (found := unrendered(prim.prim, prim.type_name)) is not None:
        code, message = found
        if code != "unsupported-prim" or is_drawn(prim.inherited, ctx.purposes):
            ctx.warn(code, prim.path, message)


def unrendered(prim: Usd.Prim, type_name: str) -> tuple[str, str] | None:
    """Return code and message for a prim without an adapter; None where nothing is lost. Geometry counts only if it is
    drawn."""
    if type_name in UNSUPPORTED:
        return "unsupported-prim", f"{type_name} is not rendered."
    if type_name in UNSUPPORTED_LIGHTS:
        return "unsupported-light", f"{type_name} is not supported."
    if prim.IsA(UsdGeom.Boundable):  # of a plug-in, or of a newer USD
        return None if type_name in _DRAWN_OTHERWISE else ("unsupported-prim", f"{type_name} is not rendered.")
    return None if _is_known(type_name) else ("unknown-prim-type", f"No schema is known by the name {type_name}.")


def _note_portal(prim: ResolvedPrim, ctx: Context) -> None:
    """Record a portal, and report its unused inputs. Whether a dome uses it is known after all lights (lights.portals)."""
    ctx.kept.of(PortalsMet).append(prim.path)
    for name in _UNUSED_BY_PORTALS:
        if name in prim.names:
            ctx.warn("light-input", prim.path, f"{name} is ignored: a portal guides a dome's samples.", name)


def _note_schemas(prim: ResolvedPrim, schemas: list[str], kind: str, ctx: Context) -> None:
    for schema in schemas:
        if schema in _LIGHT_SCHEMAS:
            _note_light_schema(prim, schema, kind, ctx)
        elif schema in PHYSICAL:
            ctx.kept.of(PhysicalSchemas).setdefault(prim.path, set()).add(schema)
            if kind != "light" and (schema in PHOTOMETRIC or not _LIGHT_SCHEMAS.intersection(schemas)):
                ctx.warn("light-input", prim.path, not_for(schema, prim.type_name))
        elif schema == "MotionAPI":
            _note_motion(prim, ctx)
        elif _is_unread(schema):
            _note_unread(schema, prim.path, ctx)


def not_for(what: str, type_name: str) -> str:
    return f"{what} is ignored: it is not for a {type_name or 'prim without a type'}."


def _note_motion(prim: ResolvedPrim, ctx: Context) -> None:
    for name in sorted(prim.names & _MOTION.keys()):
        found = read(prim.prim, name, ctx.when)
        if found != _MOTION[name]:
            ctx.warn("motion", prim.path, f"{name} = {found} is ignored, as USD itself does: it is deprecated.", name)


def _note_light_schema(prim: ResolvedPrim, schema: str, kind: str, ctx: Context) -> None:
    """Register shapes as lights; report prims that cannot be lights, such as curves, whose area is not computed."""
    if kind == "shape" and prim.type_name not in _UNLIT:
        ctx.kept.of(LightShapes).add(prim.path)
        if schema == "VolumeLightAPI":
            message = "VolumeLightAPI on a surface: it emits light as MeshLightAPI does."
            ctx.warn("light-input", prim.path, message)
    elif kind != "light" and prim.type_name not in UNSUPPORTED_LIGHTS | {"PortalLight"}:
        kept = "its shape is rendered, but emits no light" if prim.type_name in _UNLIT else "its light is missing"
        ctx.warn("unsupported-light", prim.path, f"{schema} makes this {prim.type_name or 'prim'} a light: {kept}.")


@cache
def _is_known(schema: str) -> bool:
    return bool(Usd.SchemaRegistry.GetTypeFromSchemaTypeName(schema))
