"""A prim of a stage as the walk would hand it on, and the cage that its adapter makes of it."""

from __future__ import annotations

from pxr import Usd

from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd.mesh.authored import read_mesh, topology_of
from primray.usd.mesh.subdivision import Cage, make_cage
from primray.usd.scene.context import Context
from primray.usd.scene.inheritance import Inherited, ResolvedPrim
from primray.usd.scene.poses import Poses
from primray.usd.stage.values import When


def resolved_cage(stage: Usd.Stage, path: str) -> tuple[ResolvedPrim, Cage, Context]:
    prim = stage.GetPrimAtPath(path)
    ctx = Context(stage, RenderSettings(), When(Usd.TimeCode.Default(), False), (), (), Diagnostics())
    resolved = ResolvedPrim(prim, path, "Mesh", frozenset(prim.GetAuthoredPropertyNames()), Inherited(), Poses())
    authored = read_mesh(resolved, ctx.when)
    topology = topology_of(authored, ctx)
    assert authored.subdivision is not None
    assert topology is not None
    cage = make_cage(authored, authored.subdivision, topology, ctx)
    assert cage is not None
    return resolved, cage, ctx
