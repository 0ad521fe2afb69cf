"""What a prim carries that the picture will not show: one look at each prim the walk passes, as diagnostics.

Only what any prim may carry is noted here; adapters note what is special to what they read.
"""

from __future__ import annotations

from functools import cache

from pxr import Usd

from .context import Context
from .portals import note_portal
from .resolve import ResolvedPrim

_GEOMETRY = """BasisCurves NurbsCurves HermiteCurves NurbsPatch TetMesh Volume ParticleField
    ParticleField3DGaussianSplat GenerativeProcedural"""
UNSUPPORTED = frozenset(_GEOMETRY.split())
_LIGHTS = "GeometryLight PluginLight LightFilter PluginLightFilter"
UNSUPPORTED_LIGHTS = frozenset(_LIGHTS.split())

# Applied schemas (without their instance name) that could change the picture, and what is done instead.
IGNORED_SCHEMAS = {
    "LODRootAPI": "Every level of detail is rendered.",
    "LODOverrideAPI": "Level-of-detail overrides have no effect.",
    "BackPlateAPI": "Back plates are not rendered.",
    "CoordSysAPI": "Coordinate systems are not read.",
    "ColorSpaceAPI": "",
    "ColorSpaceDefinitionAPI": "",
    "VisibilityAPI": "Visibility by purpose is not read.",
    "SkelBindingAPI": "",
}
_LIGHT_SCHEMAS = {"LightAPI", "MeshLightAPI", "VolumeLightAPI"}


def note_prim(prim: ResolvedPrim, kind: str, ctx: Context) -> None:
    """Diagnostics for one prim; `kind` is "" for types that no adapter takes."""
    schemas = [str(schema).split(":")[0] for schema in prim.prim.GetPrimTypeInfo().GetAppliedAPISchemas()]
    if schemas:
        _note_schemas(prim, schemas, kind, ctx)
    if not kind and prim.type_name:
        _note_type(prim, ctx)


def note_velocities(prim: ResolvedPrim, positions: str, ctx: Context) -> None:
    """Between two samples USD moves `positions` by their velocities; here they are interpolated or held."""
    if "velocities" not in prim.names or ctx.when.time.IsDefault():
        return
    time = ctx.when.time.GetValue()
    around = prim.prim.GetAttribute(positions).GetBracketingTimeSamples(time)
    if len(around) == 2 and time not in around:
        ctx.warn("motion", prim.path, "velocities are ignored between two samples of the positions.")


def _note_type(prim: ResolvedPrim, ctx: Context) -> None:
    if prim.type_name in UNSUPPORTED:
        if prim.inherited.purpose in ctx.purposes:
            ctx.warn("unsupported-prim", prim.path, f"{prim.type_name} is not rendered.")
    elif prim.type_name == "PortalLight":
        note_portal(prim, ctx)
    elif prim.type_name in UNSUPPORTED_LIGHTS:
        ctx.warn("unsupported-light", prim.path, f"{prim.type_name} is not supported.")
    elif prim.type_name == "SkelRoot" and prim.prim.IsInPrototype():
        ctx.warn(
            "skinning",
            prim.path,
            "Inside one of very many instances: meshes below are rendered as they are authored, not posed by their skeleton.",
        )
    elif not _is_known(prim.type_name):
        ctx.warn("unknown-prim-type", prim.path, f"No schema of the name {prim.type_name} is known.")


def _note_schemas(prim: ResolvedPrim, schemas: list[str], kind: str, ctx: Context) -> None:
    for schema in schemas:
        if schema in _LIGHT_SCHEMAS:
            _note_light_schema(prim, schema, kind, ctx)
        elif schema in ("ColorSpaceAPI", "ColorSpaceDefinitionAPI"):
            ctx.warn("color-space", prim.path, f"{schema} is applied.")
        elif schema == "VisibilityAPI":
            if any(name.endswith("Visibility") for name in prim.names):
                ctx.warn("api-schema", prim.path, IGNORED_SCHEMAS[schema])
        elif IGNORED_SCHEMAS.get(schema):
            ctx.warn("api-schema", prim.path, f"{schema}: {IGNORED_SCHEMAS[schema]}")
        elif not _is_known(schema):
            ctx.warn("api-schema", prim.path, f"{schema} is not known: what it means to the picture is ignored.")


def _note_light_schema(prim: ResolvedPrim, schema: str, kind: str, ctx: Context) -> None:
    """Shapes become lights; what is not rendered as a surface does not."""
    if kind == "shape":
        ctx.light_shapes.add(prim.path)
        if schema == "VolumeLightAPI":
            message = "VolumeLightAPI on a surface: it gives light as with MeshLightAPI."
            ctx.warn("light-input", prim.path, message)
    elif kind != "light" and prim.type_name not in UNSUPPORTED_LIGHTS | {"PortalLight"}:
        kept = "its shape is rendered unlit" if prim.type_name == "Points" else "its light is missing"
        ctx.warn("unsupported-light", prim.path, f"{schema} makes this {prim.type_name or 'prim'} a light: {kept}.")


@cache
def _is_known(schema: str) -> bool:
    return bool(Usd.SchemaRegistry.GetTypeFromSchemaTypeName(schema))
