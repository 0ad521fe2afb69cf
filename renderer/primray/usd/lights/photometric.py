"""Photometric amounts of lights: Photometric- and Radiometric-AreaLightAPI, -DomeLightAPI and -DistantLightAPI.

The text is OpenUSD-proposals' physical-lighting (July 2026). Attributes are read whether or not USD knows the schemas or they
are applied; the schemas' fallback values count only if they are applied. Photometric attributes come before radiometric ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ...color.color_space import luminance_weights
from ...color.spectrum import black_body, efficacy
from ...description.lighting import Photometric
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..scene.notes import not_for_type
from ..scene.schemas import PHOTOMETRIC
from ..stage.metadata import meters_per_unit, up_axis
from ..stage.values import flag, number
from .light_color import ENABLED, TEMPERATURES, Illuminant, white

AREA = frozenset({"RectLight", "SphereLight", "DiskLight", "CylinderLight"})
_OTHERS = {"DomeLight": "Dome", "DomeLight_1": "Dome", "DistantLight": "Distant"}


@dataclass(frozen=True)
class _Family:
    prefix: str  # of schemas: PhotometricAreaLightAPI
    power: str
    default_power: float
    received: str
    default_received: float  # of domes and distant lights

    @property
    def distance(self) -> str:
        return f"{self.received}:distance"

    @property
    def names(self) -> frozenset[str]:
        return frozenset({self.power, self.received, self.distance})


FAMILIES = (
    _Family("Photometric", "photometric:power", 1600.0, "photometric:illuminance", 10000.0),
    _Family("Radiometric", "radiometric:power", 2.34, "radiometric:irradiance", 14.64),
)
NAMES = FAMILIES[0].names | FAMILIES[1].names


GivesIlluminant = Callable[[], Illuminant | None]  # called only where watts are given: reading one may report faults


def read_amount(prim: ResolvedPrim, illuminant: GivesIlluminant, ctx: Context) -> Photometric | None:
    """Return the amount of light that is asked for, None if none is; report attributes that cannot be applied."""
    applied = ctx.findings.physical_schemas
    if prim.path not in applied and NAMES.isdisjoint(prim.names):
        return None
    schemas, kind = PHOTOMETRIC.intersection(applied.get(prim.path, ())), _kind(prim)
    for message, name in _unfit(prim, kind, schemas):
        ctx.warn("light-input", prim.path, message, name)
    asked = [f for f in FAMILIES if kind and (f"{f.prefix}{kind}LightAPI" in schemas or _fitting(f, kind) & prim.names)]
    if not asked:
        return None
    family = asked[0]
    for name in sorted(prim.names & FAMILIES[1].names if len(asked) > 1 else ()):
        ctx.warn("light-input", prim.path, f"{name} is ignored: photometric attributes take precedence.", name)
    lumens = 1.0 if family.prefix == "Photometric" else _efficacy(prim, illuminant(), ctx)
    return _asked(prim, family, kind, f"{family.prefix}{kind}LightAPI" in schemas, lumens, ctx)


def _kind(prim: ResolvedPrim) -> str:
    """Return Area, Dome or Distant, as in the schemas' names; "" for geometry lights."""
    return "Area" if prim.type_name in AREA else _OTHERS.get(prim.type_name, "")


def _fitting(family: _Family, kind: str) -> frozenset[str]:
    return family.names if kind == "Area" else frozenset({family.received})


def _unfit(prim: ResolvedPrim, kind: str, schemas: frozenset[str]) -> Iterator[tuple[str, str]]:
    """Yield a message, and the attribute or "", for each schema and attribute that does not fit the kind of light."""
    for schema in sorted(schemas):
        if schema not in {f"{family.prefix}{kind}LightAPI" for family in FAMILIES}:
            yield not_for_type(schema, prim.type_name), ""
    for family in FAMILIES:
        for name in sorted(prim.names & (family.names - (_fitting(family, kind) if kind else frozenset()))):
            yield not_for_type(name, prim.type_name), name


def _asked(prim: ResolvedPrim, family: _Family, kind: str, applied: bool, lumens: float, ctx: Context) -> Photometric | None:
    """Return the amount of a family's attributes; `lumens`: of one of its units."""
    weights = luminance_weights(ctx.rendering_space)
    if kind != "Area":
        received = _amount(prim, family.received, family.default_received, ctx)
        up = (0.0, 0.0, 1.0) if up_axis(ctx.stage) == "Z" else (0.0, 1.0, 0.0)
        return Photometric(received * lumens, weights, up=up)
    meters = meters_per_unit(ctx.stage)
    distance = _distance(prim, family, ctx)
    if distance > 0:
        return Photometric(_amount(prim, family.received, 0.0, ctx) * lumens, weights, distance / meters)
    if not applied and family.power not in prim.names:
        return None
    power = _amount(prim, family.power, family.default_power, ctx)
    return Photometric(power * lumens / meters**2, weights)


def _distance(prim: ResolvedPrim, family: _Family, ctx: Context) -> float:
    """Return the distance in metres at which illuminance is given; 0 if the power counts. Both attributes are needed."""
    there, named = family.received in prim.names, family.distance in prim.names
    if not (there or named):
        return 0.0
    distance = number(prim.prim, family.distance, ctx.when, 0.0, ctx.diagnostics)
    if distance < 0:
        ctx.warn("out-of-range", prim.path, f"{family.distance} = {distance:g} is negative: it is ignored.", family.distance)
    elif distance == 0 and there:
        ctx.warn("light-input", prim.path, f"{family.received} is ignored: {family.distance} is 0.", family.received)
    elif distance > 0 and not there:
        ctx.warn("light-input", prim.path, f"{family.distance} is ignored without {family.received}.", family.distance)
        return 0.0
    return max(distance, 0.0)


def _amount(prim: ResolvedPrim, name: str, default: float, ctx: Context) -> float:
    found = number(prim.prim, name, ctx.when, default, ctx.diagnostics)
    if found < 0:
        ctx.warn("out-of-range", prim.path, f"{name} = {found:g} is negative: 0 is used.", name)
    return max(found, 0.0)


def _efficacy(prim: ResolvedPrim, illuminant: Illuminant | None, ctx: Context) -> float:
    """Return the efficacy in lumens per watt of the illuminant's spectrum, else of the colour temperature, else of white."""
    if illuminant is not None:
        return efficacy(illuminant.spectrum)
    if ENABLED in prim.names and flag(prim.prim, ENABLED, ctx.when, False):
        kelvin = number(prim.prim, TEMPERATURES[-1], ctx.when, 6500.0, ctx.diagnostics)
        return efficacy(black_body(min(max(kelvin, 1000.0), 10000.0)))
    return efficacy(white(ctx))
