"""Groups of leaves and of instances of other groups, flattened: where each group stands in the world. No USD, only numpy.

A group is the stage itself, or a prototype with what one kind of instance hands down to it. Every group is walked once,
whatever the number of its instances; their matrices multiply here, in double.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from ..description import Doubles
from ..errors import LimitError
from .convert import compose_into

MATRIX_BYTES = 96  # (3, 4) float64

Leaf = TypeVar("Leaf")


@dataclass
class Group(Generic[Leaf]):
    path: str
    leaves: list[Leaf] = field(default_factory=list)
    instances: list[tuple[int, Doubles]] = field(default_factory=list)  # (group, (K, 3, 4) group_from_instance)


def flatten(groups: list[Group[Leaf]], max_bytes: int | None) -> tuple[list[Doubles], list[tuple[int, int]]]:
    """world_from_group (K, 3, 4) of every group, and the instancings left out because a group contains itself.

    The first group is the world. LimitError before it takes more than `max_bytes`.
    """
    order, cyclic = _order(groups)
    _check_limit(groups, order, cyclic, max_bytes)
    parents: dict[int, list[tuple[int, Doubles]]] = {g: [] for g in order}
    for g in order:
        for child, matrices in groups[g].instances:
            if (g, child) not in cyclic:
                parents[child].append((g, matrices))
    world: list[Doubles] = [np.zeros((0, 3, 4)) for _ in groups]
    world[0] = np.eye(4)[None, :3, :]
    for g in order[1:]:
        world[g] = _placed(parents[g], world)
    return world, sorted(cyclic)


def _placed(edges: list[tuple[int, Doubles]], world: list[Doubles]) -> Doubles:
    if len(edges) == 1 and edges[0][0] == 0:  # straight from the world, whose matrix is the identity
        return edges[0][1]
    total = sum(len(world[parent]) * len(matrices) for parent, matrices in edges)
    out = np.empty((total, 3, 4))
    start = 0
    for parent, matrices in edges:
        end = start + len(world[parent]) * len(matrices)
        compose_into(out[start:end], world[parent], matrices)
        start = end
    return out


def _order(groups: list[Group[Leaf]]) -> tuple[list[int], set[tuple[int, int]]]:
    """Groups reachable from the world, parents before children, and the edges that close a cycle."""
    done: list[int] = []
    state: dict[int, int] = {0: 1}  # 1: on the stack, 2: done
    cyclic: set[tuple[int, int]] = set()
    stack = [(0, iter([child for child, _ in groups[0].instances]))]
    while stack:
        g, children = stack[-1]
        child = next(children, None)
        if child is None:
            stack.pop()
            state[g] = 2
            done.append(g)
        elif state.get(child) == 1:
            cyclic.add((g, child))
        elif child not in state:
            state[child] = 1
            stack.append((child, iter([c for c, _ in groups[child].instances])))
    return done[::-1], cyclic


def _check_limit(groups: list[Group[Leaf]], order: list[int], cyclic: set[tuple[int, int]], max_bytes: int | None) -> None:
    counts = dict.fromkeys(order, 0)
    counts[0] = 1
    for g in order:
        for child, matrices in groups[g].instances:
            if (g, child) not in cyclic:
                counts[child] += counts[g] * len(matrices)
    total = sum(counts.values()) * MATRIX_BYTES
    if max_bytes is not None and total > max_bytes:
        biggest = max(order, key=lambda g: counts[g])
        raise LimitError(
            f"The stage has {sum(counts.values()):,} instances once nesting is flattened; their matrices alone take "
            f"{total / 1e6:,.0f} MB, more than the limit of {max_bytes / 1e6:,.0f} MB.",
            where=groups[biggest].path,
            code="memory-limit",
        )
