"""Diagnostics about a prim itself: authored types, schemas and names that the picture will not show.

Only what any prim may carry is noted here: unsupported types, unknown schemas and inputs of lights, attributes for other
renderers and programs. Adapters report what is special to the prims that they read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache

from pxr import Usd, UsdGeom

from ..materials.materialx.document_marks import NOTES
from ..skinning.bindings import JOINT_WEIGHTS, has_weights, why_unposed
from ..stage.metadata import default_prim
from ..stage.values import read
from .context import Context
from .inheritance import ResolvedPrim, is_drawn
from .schemas import (
    CAMERA_VISIBILITY,
    CONVENTIONS,
    IGNORED,
    LEFT_OUT,
    LENS_WORDS,
    LIGHT_GROUPS,
    PHOTOMETRIC,
    PHYSICAL,
    ROLLING_SHUTTER,
    SETTINGS_OF_OTHERS,
    UNDERSTOOD,
    VELOCITY_SCALES,
    applied_schemas,
    foreign_schema,
    is_without_effect,
)

_GEOMETRY = "ParticleField ParticleField3DGaussianSplat GenerativeProcedural"
UNSUPPORTED = frozenset(_GEOMETRY.split())
_LIGHTS = "GeometryLight PluginLight LightFilter PluginLightFilter"
UNSUPPORTED_LIGHTS = frozenset(_LIGHTS.split())

_FOG, _VOLUME = "PrimrayFogAPI", "PrimrayVolumeAPI"
_LIGHT_SCHEMAS = {"LightAPI", "MeshLightAPI", "VolumeLightAPI"}
_TYPES_NOTED = UNSUPPORTED | UNSUPPORTED_LIGHTS | {"PortalLight"}
_UNLIT = frozenset({"Points", "BasisCurves", "HermiteCurves", "NurbsCurves"})
_DRAWN_OTHERWISE = frozenset({"PointInstancer", "Points", "SkelRoot", "Skeleton"})
# Inputs that any light has, but which do nothing on a portal: it only guides a dome's samples.
_UNUSED_BY_PORTALS = ("inputs:intensity", "inputs:exposure", "inputs:color", "inputs:normalize",
                      "inputs:enableColorTemperature", "inputs:diffuse", "inputs:specular")  # fmt: skip
# UsdGeom MotionAPI: attribute -> the value that changes nothing.
_MOTION = {"motion:velocityScale": 1.0}


def is_noted(prim: Usd.Prim, type_name: str, schemas: list[str], properties: frozenset[str], kind: str) -> bool:
    """Return whether `note_prim` may report anything for prims of this type with these schemas, of which `prim` is one."""
    names = {schema.split(":")[0] for schema in schemas}
    is_light = kind == "light" or bool(names & _LIGHT_SCHEMAS)
    if (
        is_light
        or JOINT_WEIGHTS in properties
        or NOTES in properties
        or "MotionAPI" in names
        or _FOG in names
        or _VOLUME in names
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
    if LEFT_OUT in prim.names:
        return
    if schemas:
        _note_schemas(prim, schemas, kind, ctx)
    if kind == "light" or "LightAPI" in schemas:
        note_light_inputs(prim, applied, ctx)
    if NOTES in prim.names:
        note_document(prim.prim, prim.path, ctx)
    if JOINT_WEIGHTS in prim.names:
        _note_weights(prim, schemas, ctx)
    if not kind and prim.type_name:
        _note_type(prim, ctx)


def note_unknown_schemas(prim: Usd.Prim, path: str, ctx: Context) -> None:
    """Report unread schemas of a prim that the walk does not visit: a shader."""
    for schema in filter(_is_unread, {schema.split(":")[0] for schema in applied_schemas(prim)}):
        _note_unread(schema, path, ctx)


def note_document(prim: Usd.Prim, path: str, ctx: Context) -> None:
    """Report the parts of a prim's MaterialX document that have no effect, as noted on the prim."""
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


def _note_fog(prim: ResolvedPrim, ctx: Context) -> None:
    if prim.type_name != "Camera" and str(prim.prim.GetPath()) != default_prim(ctx.stage):
        message = (
            f"{_FOG}: Only the stage's default prim and cameras have fog: it is ignored. Fill a shape for fog in one place."
        )
        ctx.warn("api-schema", prim.path, message)


def _note_weights(prim: ResolvedPrim, schemas: list[str], ctx: Context) -> None:
    if is_drawn(prim.inherited, ctx.purposes) and has_weights(prim.prim):
        reason = why_unposed(prim.prim, ctx.stage.GetPrimAtPath(prim.path), schemas)
        if reason:
            ctx.warn("skinning", prim.path, f"It has joint weights and is not posed: {reason}.", JOINT_WEIGHTS)


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
    ctx.findings.portals.append(prim.path)
    for name in _UNUSED_BY_PORTALS:
        if name in prim.names:
            ctx.warn("light-input", prim.path, f"{name} is ignored: a portal guides a dome's samples.", name)


def _note_schemas(prim: ResolvedPrim, schemas: list[str], kind: str, ctx: Context) -> None:
    for schema in schemas:
        if schema in _LIGHT_SCHEMAS:
            _note_light_schema(prim, schema, kind, ctx)
        elif schema in PHYSICAL:
            ctx.findings.physical_schemas.setdefault(prim.path, set()).add(schema)
            if kind != "light" and (schema in PHOTOMETRIC or not _LIGHT_SCHEMAS.intersection(schemas)):
                ctx.warn("light-input", prim.path, not_for_type(schema, prim.type_name))
        elif schema == "MotionAPI":
            _note_motion(prim, ctx)
        elif schema == _FOG:
            _note_fog(prim, ctx)
        elif schema == _VOLUME and prim.type_name not in ("Volume", "Material"):
            message = f"{_VOLUME}: Only Volume prims and materials have it: it is ignored. Apply it to the shape's material."
            ctx.warn("api-schema", prim.path, message)
        elif _is_unread(schema):
            _note_unread(schema, prim.path, ctx)


def not_for_type(what: str, type_name: str) -> str:
    return f"{what} is ignored: it is not for a {type_name or 'prim without a type'}."


def _note_motion(prim: ResolvedPrim, ctx: Context) -> None:
    for name in sorted(prim.names & _MOTION.keys()):
        found = read(prim.prim, name, ctx.when)
        if found != _MOTION[name]:
            ctx.warn("motion", prim.path, f"{name} = {found} is ignored, as USD itself does: it is deprecated.", name)


def _note_light_schema(prim: ResolvedPrim, schema: str, kind: str, ctx: Context) -> None:
    """Register shapes and volumes as lights; report prims that cannot be lights, such as curves, whose area is not computed."""
    if kind == "shape" and prim.type_name not in _UNLIT:
        ctx.findings.light_shapes.add(prim.path)
        if schema == "VolumeLightAPI":
            message = "VolumeLightAPI on a surface: it emits light as MeshLightAPI does."
            ctx.warn("light-input", prim.path, message)
    elif kind == "volume":
        ctx.findings.light_shapes.add(prim.path)
    elif kind != "light" and prim.type_name not in UNSUPPORTED_LIGHTS | {"PortalLight"}:
        kept = "its shape is rendered, but emits no light" if prim.type_name in _UNLIT else "its light is missing"
        ctx.warn("unsupported-light", prim.path, f"{schema} makes this {prim.type_name or 'prim'} a light: {kept}.")


@cache
def _is_known(schema: str) -> bool:
    return bool(Usd.SchemaRegistry.GetTypeFromSchemaTypeName(schema))


# First words of the namespaces that renderers document for their attributes (arnold-usd, hdPrman, Karma, Redshift, V-Ray,
# Octane, Cycles' and MoonRay's Hydra delegates, Omniverse, Radeon ProRender, 3Delight), maybe within primvars: or outputs:.
_RENDERER_NAMES = "arnold cycles husk karma mantra mitsuba moonray nsi octane omni prman redshift ri rman rpr vray"
RENDERERS = frozenset(_RENDERER_NAMES.split())
_WITHIN = frozenset({"primvars", "inputs", "outputs"})
# Schemas of lights in general; a light's prim definition has those that its type applies.
_SCHEMAS_OF_LIGHTS = ("LightAPI", "ShapingAPI", "ShadowAPI")
_EXTENSIONS = ("inputs:visibility:",)  # read by some renderers, no part of UsdLux

# Other renderers' attributes that are read here, or are reported by their own readers.
_READ = frozenset((*CAMERA_VISIBILITY, *LIGHT_GROUPS, *SETTINGS_OF_OTHERS, *VELOCITY_SCALES)) | {
    name for c in CONVENTIONS for name in (c.blades, c.rotation_deg, c.roundness)
}

# The outputs of any renderer that are read, or reported by materials/material.py and volumes/shaders.py.
_SHADER_OUTPUT = re.compile(r"outputs:\w+:(surface|volume)")


@dataclass
class NameSet:
    """Authored names, and how many prims have exactly these."""

    names: frozenset[str]
    first_path: str
    count: int = 0


def renderer_of(name: str) -> str:
    """Return the renderer that an attribute belongs to; "" for none, or where the attribute is read here."""
    if (
        name in _READ
        or name.startswith(ROLLING_SHUTTER)
        or _SHADER_OUTPUT.fullmatch(name)
        or any(word in name.lower() for word in LENS_WORDS)
    ):
        return ""
    first, _, rest = name.partition(":")
    if first in _WITHIN:
        first, _, rest = rest.partition(":")
    return first if rest and first in RENDERERS else ""


def note_other_renderers(sets: Iterable[NameSet], ctx: Context) -> None:
    """Report attributes of other renderers, once per namespace, however many prims have them."""
    found: dict[str, dict[str, NameSet]] = {}
    prims: dict[str, int] = {}
    for names in sets:
        for renderer in {renderer_of(name) for name in names.names} - {""}:
            prims[renderer] = prims.get(renderer, 0) + names.count
            for name in sorted(names.names):
                if renderer_of(name) == renderer:
                    found.setdefault(renderer, {}).setdefault(name, names)
    for renderer, attributes in sorted(found.items()):
        first, names = next(iter(attributes.items()))
        many = f"{len(attributes)} attributes" if len(attributes) > 1 else "An attribute"
        of = f"{prims[renderer]:,} prims" if prims[renderer] > 1 else "this prim"
        ctx.warn("other-renderer", ctx.shown(names.first_path), f"{many} of the namespace {renderer} on {of}: ignored.", first)


@dataclass
class _Family:
    first_path: str
    meaning: str
    names: set[str] = field(default_factory=set)
    prims: int = 0


def note_foreign_schemas(sets: Iterable[tuple[NameSet, Iterable[str]]], ctx: Context) -> None:
    """Report schemas of other programs that have no effect, once per family."""
    found: dict[str, _Family] = {}
    for prims, schemas in sets:
        rows = {name: foreign_schema(name) for name in schemas}
        told = {name: row for name, row in rows.items() if row and not row.changes_picture}
        for row in sorted(set(told.values()), key=lambda row: row.family):
            known = found.setdefault(row.family, _Family(prims.first_path, row.meaning))
            known.names |= {name for name, other in told.items() if other == row}
            known.prims += prims.count
    for family in found.values():
        names = sorted(family.names)
        what = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
        on = f"{family.prims:,} prims" if family.prims > 1 else "this prim"
        ctx.warn("foreign-schema", ctx.shown(family.first_path), f"{what} on {on}. {family.meaning}")


def note_light_inputs(prim: ResolvedPrim, applied: list[str], ctx: Context) -> None:
    """Report inputs that no schema of lights defines, and those with names from before USD 21.02."""
    key = (prim.type_name, tuple(applied), prim.names)
    known = ctx.caches.light_inputs
    if key not in known:  # the same for all lights of a kind
        known[key] = list(_findings_of_inputs(prim))
    for code, message, name in known[key]:
        ctx.warn(code, prim.path, message, name)


def _findings_of_inputs(prim: ResolvedPrim) -> Iterator[tuple[str, str, str]]:
    defined = set(prim.prim.GetPrimDefinition().GetPropertyNames()) | _of_light_schemas()
    for name in sorted(prim.names - defined):
        if name.startswith("inputs:"):
            if not name.startswith(_EXTENSIONS) and not renderer_of(name):
                yield "unknown-input", f"{prim.type_name} has no such input.", name
        elif f"inputs:{name}" in defined and f"inputs:{name}" not in prim.names:
            yield "old-attribute", f"It is ignored: lights read inputs:{name}.", name


@cache
def _of_light_schemas() -> frozenset[str]:
    registry = Usd.SchemaRegistry()
    return frozenset(
        name for schema in _SCHEMAS_OF_LIGHTS for name in registry.FindAppliedAPIPrimDefinition(schema).GetPropertyNames()
    )
