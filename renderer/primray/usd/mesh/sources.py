"""Prims whose geometry is authored at the same place, such as a thousand references to one of a hundred meshes.

Without time samples, a mesh is what the specs of its prim index say, the strongest first. Specs that only place it, or colour
it as a whole, say nothing of its geometry: prims that have all other specs in common are read once.
"""

from __future__ import annotations

from pxr import Sdf

from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.metadata import names_in

Source = tuple[str | Sdf.PrimSpec, ...]
# Properties that the geometry does not depend on.
_APART = frozenset({"xformOpOrder", "visibility", "purpose", "primvars:displayColor", "primvars:displayOpacity"})
_PREFIXES = ("xformOp:", "material:binding")


def source_of(prim: ResolvedPrim, ctx: Context) -> Source | None:
    """Return a key of the prim's type and the specs that decide its geometry; None where it has opinions of its own, or others
    cannot have the same."""
    if ctx.when.careful or not ctx.when.is_default or not ctx.timing.is_frame:
        return None
    stack = prim.prim.GetPrimStack()
    deciding = stack if len(stack) < 2 else [spec for spec in stack if not _is_apart(spec)]
    if not deciding or deciding[0].path.pathString == prim.path:
        return None
    return (prim.type_name, *deciding)


def _is_apart(spec: Sdf.PrimSpec) -> bool:
    for name in names_in(spec):  # noqa: SIM110 - all() takes twice as long for so few
        if name not in _APART and not name.startswith(_PREFIXES):
            return False
    return True
