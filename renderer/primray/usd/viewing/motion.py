"""What moves while the shutter is open. The scene is rendered as it stands at the frame, and this says so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from ...description import Camera
from ..querying.guarded import authored_attributes, is_invisible, purpose_of, type_name, value_at
from ..querying.time_varying import changes, has_times, may_have_spline, might_change, number_of
from ..querying.traversal import in_world, instanced_roots, stands_in_world, there_below
from ..resolving.context import Context
from ..resolving.prim_kinds import KindsMet, PropertyNames
from ..resolving.read import When, has_samples_or_clips, time_of, value

LISTED = 8
# Changes of these are no motion; primvars (but for normals, which follow points) are colours and the like.
STILL = frozenset(["visibility", "purpose", "extent", "extentsHint", "velocities", "accelerations", "angularVelocities"])
VELOCITIES = ("velocities", "angularVelocities")


@dataclass(frozen=True)
class Span:
    """The open shutter around the frame, and how that is read."""

    when: When
    opens: float
    closes: float

    def around(self, attribute: Usd.Attribute) -> tuple[float, float] | None:
        time = number_of(time_of(attribute, self.when), attribute)
        return None if time is None else (time + self.opens, time + self.closes)


def note_motion(camera: Camera, ctx: Context) -> None:
    """One diagnostic of the camera's, naming some of what moves and how much there is of it."""
    opens, closes = camera.shutter
    if not opens < closes:
        return
    is_timed = ctx.when.careful if ctx.when.is_default else has_samples_or_clips(ctx.stage)
    types = None if is_timed else _types_with_scalars(ctx)
    if types is not None and not types:
        return
    span = Span(ctx.when, opens, closes)
    moving: dict[Sdf.Path, str] = {}
    for prim, root in _prims(ctx, camera.path):
        if types is not None and type_name(prim) not in types:
            continue
        name = next(_moving(prim, span), None)
        if name is not None and prim.GetPath() not in moving and _is_seen(prim, root, span.when.time, ctx.purposes):
            moving[prim.GetPath()] = name
    if moving:
        named = ", ".join(f"{path} ({name})" for path, name in list(moving.items())[:LISTED])
        more = f" and {len(moving) - LISTED:,} more" if len(moving) > LISTED else ""
        message = f"The shutter is open from {opens:g} to {closes:g}, but the scene is rendered at one instant. What moves: "
        ctx.warn("motion", camera.path, f"{message}{named}{more}.", "shutter:close")


def _types_with_scalars(ctx: Context) -> frozenset[str]:
    """The types of prims that may have splines, when nothing else is given for times: what has none is not looked at."""
    first = ((kind, ctx.stage.GetPrimAtPath(kind.first_path)) for kind in ctx.kept.of(KindsMet))
    return frozenset(kind.type_name for kind, prim in first if not prim or any(map(may_have_spline, authored_attributes(prim))))


def _prims(ctx: Context, camera: str) -> Iterator[tuple[Usd.Prim, Usd.Prim | None]]:
    """Whatever has a place in the scene; of the cameras, the one that looks. Prototypes of point instancers come with their
    root: what is above that hides them from where they stand only."""
    looking = ctx.stage.GetPrimAtPath(camera) if camera else None
    if looking and looking.IsInstanceProxy():
        yield looking, None
    for prims in (in_world(ctx.stage), *map(there_below, ctx.stage.GetPrototypes())):
        for prim in prims:
            if prim.IsA(UsdGeom.Camera):
                if str(prim.GetPath()) == camera:
                    yield prim, None
            elif prim.IsA(UsdGeom.Imageable) or type_name(prim) == "SkelAnimation":
                yield prim, None
    if any("prototypes" in names for names in ctx.kept.of(PropertyNames)):
        for root in instanced_roots(ctx.stage):
            if not stands_in_world(root) or _is_hidden_above(root, ctx.when.time):
                yield from ((prim, root) for prim in there_below(root) if not prim.IsA(UsdGeom.Camera))


def _moving(prim: Usd.Prim, span: Span) -> Iterator[str]:
    """Names of its attributes that change while the shutter is open, or of velocities that say that it moves."""
    for attribute in authored_attributes(prim):
        name = attribute.GetName()
        if name in VELOCITIES:
            if _is_nonzero(attribute, span.when):
                yield name
        elif name not in STILL and not name.startswith("primvars:") and might_change(attribute):
            around = span.around(attribute)
            if around is not None and changes(attribute, *around):
                yield name


def _is_nonzero(attribute: Usd.Attribute, when: When) -> bool:
    """Velocities count from a sample of the positions on: without samples nothing moves."""
    if not has_times(attribute):
        return False
    values = np.asarray(value(attribute, when))
    return values.dtype.kind == "f" and bool(values.any())


def _is_hidden_above(root: Usd.Prim, time: Usd.TimeCode) -> bool:
    above = root.GetParent()
    return bool(UsdGeom.Imageable(above)) and is_invisible(above, time)


def _is_seen(prim: Usd.Prim, root: Usd.Prim | None, time: Usd.TimeCode, purposes: tuple[str, ...]) -> bool:
    imageable = UsdGeom.Imageable(prim)
    if not imageable:
        return True
    if purpose_of(prim) not in purposes:
        return False
    return not is_invisible(prim, time) if root is None else not _is_hidden_below(prim, root, time)


def _is_hidden_below(prim: Usd.Prim, root: Usd.Prim, time: Usd.TimeCode) -> bool:
    """By an opinion between them."""
    while prim:
        attribute = prim.GetAttribute("visibility")
        if attribute and value_at(attribute, time) == "invisible":
            return True
        if prim == root:
            return False
        prim = prim.GetParent()
    return False
