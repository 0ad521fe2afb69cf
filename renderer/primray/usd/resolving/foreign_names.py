"""Authored names that no schema of USD's defines: unknown inputs of lights, and attributes for other renderers and programs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache

from pxr import Usd

from .applied_schemas import foreign_schema
from .context import Context
from .renderer_attributes import (
    CAMERA_VISIBILITY,
    CONVENTIONS,
    LENS_WORDS,
    LIGHT_GROUPS,
    ROLLING_SHUTTER,
    SETTINGS_OF_OTHERS,
)
from .resolve import ResolvedPrim

# First words of the namespaces that renderers document for their attributes (arnold-usd, hdPrman, Karma, Redshift, V-Ray,
# Octane, Cycles' and MoonRay's Hydra delegates, Omniverse, Radeon ProRender, 3Delight), maybe within primvars: or outputs:.
_RENDERERS = "arnold cycles husk karma mantra mitsuba moonray nsi octane omni prman redshift ri rman rpr vray"
RENDERERS = frozenset(_RENDERERS.split())
_WITHIN = frozenset({"primvars", "inputs", "outputs"})
# Schemas of lights in general; a light's prim definition has those that its type applies.
_LIGHT_SCHEMAS = ("LightAPI", "ShapingAPI", "ShadowAPI")
_EXTENSIONS = ("inputs:visibility:",)  # read by some renderers, no part of UsdLux

# Other renderers' attributes that are read here, or are reported by their own readers.
_READ = frozenset((*CAMERA_VISIBILITY, *LIGHT_GROUPS, *SETTINGS_OF_OTHERS)) | {
    name for c in CONVENTIONS for name in (c.blades, c.rotation_deg, c.roundness)
}

# The surface output of any renderer: adapters/materials/material.py reads it, or reports that it does not.
_SURFACE_OUTPUT = re.compile(r"outputs:\w+:surface")


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
        or _SURFACE_OUTPUT.fullmatch(name)
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


class _LightInputs(dict[tuple[str, tuple[str, ...], frozenset[str]], list[tuple[str, str, str]]]):
    """Findings about the inputs of lights (code, message, attribute), by type, applied schemas and authored names."""


def note_light_inputs(prim: ResolvedPrim, applied: list[str], ctx: Context) -> None:
    """Report inputs that no schema of lights defines, and those with names from before USD 21.02."""
    key = (prim.type_name, tuple(applied), prim.names)
    known = ctx.kept.of(_LightInputs)
    if key not in known:  # the same for all lights of a kind
        known[key] = list(_told_of_inputs(prim))
    for code, message, name in known[key]:
        ctx.warn(code, prim.path, message, name)


def _told_of_inputs(prim: ResolvedPrim) -> Iterator[tuple[str, str, str]]:
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
        name for schema in _LIGHT_SCHEMAS for name in registry.FindAppliedAPIPrimDefinition(schema).GetPropertyNames()
    )
