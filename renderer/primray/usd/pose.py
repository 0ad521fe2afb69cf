"""Meshes bound to skeletons, posed by USD's own skinning (UsdSkel.BakeSkinning): joints, blend shapes, normals.

The posed values are opinions in the session layer of another stage on the same layers, so neither files nor the caller's stage
change. Skeletons inside native instances are out of its reach.
"""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Gf, Tf, Usd, UsdSkel

from ..diagnostics import Diagnostics
from .read import When, value
from .stage import scratch_copy, tf_message


def posed(stage: Usd.Stage, roots: list[str], when: When, diagnostics: Diagnostics) -> Usd.Stage:
    """The stage as the skeletons below `roots` pose it."""
    made = scratch_copy(stage)
    made.SetEditTarget(made.GetSessionLayer())
    for path in roots:
        problem = _pose(UsdSkel.Root(made.GetPrimAtPath(path)), when)
        if problem:
            diagnostics.add("skinning", path, problem)
        else:
            diagnostics.add("posed", path, "Meshes below are posed by their skeleton.")
    return made


def _pose(root: UsdSkel.Root, when: When) -> str:
    """What went wrong, if anything. Baking visits authored samples only, so all that moves is first held where it now is."""
    try:
        for prim in _involved(root):
            for attribute in prim.GetAuthoredAttributes():
                if attribute.GetNumTimeSamples() > 0:
                    present = value(attribute, when)
                    if present is not None:
                        attribute.Set(present)
        return "" if UsdSkel.BakeSkinning(root, Gf.Interval(0, 0)) else "USD cannot pose it."
    except Tf.ErrorException as error:
        return f"USD cannot pose it: {tf_message(error)}"


def _involved(root: UsdSkel.Root) -> Iterator[Usd.Prim]:
    """Everything that the pose depends on: what stands above and below the root, and the animations."""
    above = root.GetPrim().GetParent()
    while above and not above.IsPseudoRoot():
        yield above
        above = above.GetParent()
    yield from Usd.PrimRange(root.GetPrim())
    cache = UsdSkel.Cache()
    if cache.Populate(root, Usd.PrimDefaultPredicate):
        for binding in cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate):
            animation = cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery()
            if animation and not animation.GetPrim().IsInstanceProxy():
                yield animation.GetPrim()
