"""Parts of a translation that depend on an attribute's value, by the attribute's name and the type of its prim."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from pxr import Sdf, Usd

from ..querying.guarded import type_name
from ..walking.record import Record
from .not_known import NotKnownError

# Types that are read again for every picture, and affect nothing else.
_LOOKED_UP = frozenset({"Camera", "RenderSettings", "RenderProduct", "RenderVar"})
_SHADING = frozenset({"Shader", "NodeGraph", "Material"})
# Attributes that are inherited, or that decide which prims are drawn.
_HANDED = ("primvars:", "motion:", "material:", "collection:", "model:", "xformOp", "colorSpace", "skel:")
_DECIDING = frozenset({"visibility", "purpose", "guideVisibility", "proxyVisibility", "renderVisibility", "proxyPrim"})


@dataclass
class Touched:
    """Paths of prims whose transforms have changed, of leaves with other values, and of shading prims with other values."""

    moved: set[str] = field(default_factory=set)
    leaves: set[str] = field(default_factory=set)
    shading: set[Sdf.Path] = field(default_factory=set)


def touched_by(paths: Iterable[Sdf.Path], stage: Usd.Stage, record: Record) -> Touched:
    """Return what these attributes affect; raise NotKnownError where one of them may affect anything."""
    found = Touched()
    for path in paths:
        prim, name = stage.GetPrimAtPath(path.GetPrimPath()), path.name
        kind, at = type_name(prim) if prim else "", str(path.GetPrimPath())
        if name.startswith("xformOp:"):
            found.moved.add(at)
        elif kind in _SHADING and name.startswith("inputs:"):
            found.shading.add(path.GetPrimPath())
        elif name in _DECIDING or name.startswith(_HANDED) or kind in _SHADING:
            raise NotKnownError
        elif at in record.leaves:
            found.leaves.add(at)
        elif kind not in _LOOKED_UP:
            raise NotKnownError
    return found
