"""Adapter for polygonal meshes with a displaced material: a bilinear cage that keeps the polygons' corners, for the dicer."""

from __future__ import annotations

from dataclasses import replace

from ....description import DisplacedMesh, SubdivisionMesh
from ...scene.context import Context
from ...scene.inheritance import ResolvedPrim
from ...shapes.polygon_cage import cage_of, welded
from ...shapes.polygons import Polygons
from .cage import make_subdivision_mesh
from .face_parts import FaceParts


def displaced_polygons(prim: ResolvedPrim, geometry: Polygons, parts: FaceParts, ctx: Context) -> SubdivisionMesh | None:
    found, normals = cage_of(geometry)
    made = make_subdivision_mesh(prim, found, ctx, parts)
    return welded(replace(made, normals=normals)) if isinstance(made, DisplacedMesh) else made
