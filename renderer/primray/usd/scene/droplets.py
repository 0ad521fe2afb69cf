"""Water droplets of fog and volumes: the diameter by which PrimrayFogAPI and PrimrayVolumeAPI ask for their phase function."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Usd

from ..stage.reads import property_names
from ..stage.values import number, report_without_value
from .context import Context

PREFIX = "primray:volume:"
DIAMETER = f"{PREFIX}dropletDiameter"
LARGEST = 50.0  # micrometres: where the fit of the core's phase function ends


def droplets_of(prims: Iterable[Usd.Prim | None], ctx: Context) -> float:
    """Return the diameter in micrometres that the first of these prims asks for by PrimrayVolumeAPI; 0: none does."""
    for prim in prims:
        if prim is None:
            continue
        names = [name for name in property_names(prim) if name.startswith(PREFIX)]
        for name in sorted(names):
            if name != DIAMETER:
                message = f"{name} is ignored: PrimrayVolumeAPI has no such attribute."
                ctx.warn("unknown-input", ctx.shown(str(prim.GetPath())), message, name)
        report_without_value(prim, (DIAMETER,), ctx.when, ctx.diagnostics)
        if names:
            return diameter(prim, DIAMETER, ctx)
    return 0.0


def diameter(prim: Usd.Prim, name: str, ctx: Context) -> float:
    """Return the diameter of an attribute in micrometres, 0 where it has none."""
    found = number(prim, name, ctx.when, 0.0, ctx.diagnostics)
    if not 0.0 <= found <= LARGEST:
        message = f"{name} = {found:g} is outside of 0 to {LARGEST:g} micrometres and is clamped."
        ctx.warn("out-of-range", ctx.shown(str(prim.GetPath())), message, name)
    return min(max(found, 0.0), LARGEST)
