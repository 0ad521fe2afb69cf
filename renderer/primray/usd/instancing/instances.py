"""Instancing: placements of groups of leaves and of instances of other groups. No USD, only numbers.

A group is the stage itself, or a prototype with the state that one kind of instance hands down to it. Every group is walked
once, whatever the number of its instances. Its placements are a list of chains: products of levels of instances, not multiplied
out. `grouping` chooses the groups that keep their own instances together because all products would take too much memory.

Instances that exactly coincide with another one are removed: each of them would have to be tested by rays through that place,
and ten thousand cost Embree a millisecond per ray. The image is the same: a ray hits one of several coincident surfaces and
continues beyond all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from ...description.placement import (
    Instances,
    MatrixInstances,
    Names,
    PointInstances,
    chunks,
    instance_name,
    named_levels,
    texts,
)
from ...errors import LimitError
from ..motion.levels import any_moves, chain_at, concatenated_levels

# A few coincident instances cost nothing, while looking for them in many small placements would.
FEWEST_INSTANCES = 32
# Larger placements are first tested by this many random instances, which reveal crowds that matter (some 1000 of 10 million).
SAMPLE = 1 << 16

Words = npt.NDArray[np.uint64]


def without_coincident(level: Instances) -> Instances:
    """Return the instances without exact duplicates in matrix (or position, orientation and scale) and primvars; the first of
    each is kept."""
    count = len(level)
    if count < FEWEST_INSTANCES:
        return level
    columns = _columns(level)
    if count > SAMPLE:
        chosen = np.random.default_rng(0).integers(0, count, SAMPLE)
        chosen = np.unique(chosen)  # drawn with replacement
        if len(_repeated_rows([c[chosen] for c in columns])) == 0:
            return level
    repeated = _repeated_rows(columns)
    if len(repeated) == 0:
        return level
    keep = np.ones(count, np.bool_)
    keep[repeated] = False
    return level.take(keep)


def _columns(level: Instances) -> list[npt.NDArray[Any]]:
    """Return arrays (K, n) whose rows together identify an instance."""
    if isinstance(level, PointInstances):
        own = [level.positions, level.orientations, level.scales]
    else:
        own = [level.matrices.reshape(len(level), 12)]
    return [c for c in own if c is not None] + [p.values.reshape(len(level), -1) for p in level.primvars]


def _repeated_rows(columns: list[npt.NDArray[Any]]) -> npt.NDArray[np.int64]:
    """Return the rows equal to an earlier one; some may be missed if different rows have the same hash."""
    hashes = _row_hashes(columns)
    order = np.argsort(hashes, kind="stable")
    again = np.flatnonzero(hashes[order[1:]] == hashes[order[:-1]])
    earlier, later = order[again], order[again + 1]
    same = np.ones(len(again), np.bool_)
    for column in columns:
        same &= np.asarray((column[earlier] == column[later]).all(axis=1))
    return np.asarray(later[same])


def _row_hashes(columns: list[npt.NDArray[Any]]) -> Words:
    """Return a 64-bit hash per row, equal for equal rows (0 and -0 count as equal)."""
    total = np.zeros(len(columns[0]), np.uint64)
    for column in columns:
        for k in range(column.shape[1]):
            # Half of the finalizer of MurmurHash3's 64-bit mix, after each number.
            total ^= (column[:, k].astype(np.float64) + 0.0).view(np.uint64)
            total *= np.uint64(0xFF51AFD7ED558CCD)
            total ^= total >> np.uint64(33)
    return total


# Bytes in the core and Embree, including the peak of its build: measured by python -m tests.bench.setup.scaling.
INSTANCE_BYTES = 200
# More instances than this are kept in two levels where that at least halves what is stored: as fast at this size, and faster
# beyond (python -m tests.bench.setup.two_levels). A constant, so that pictures do not depend on the machine: geometry seen
# through two float matrices is rounded differently from geometry seen through their product.
MAX_FLAT_INSTANCES = 1 << 20
# Chains of at most this many instances are multiplied out, so that a prototype reached along many paths has few placements.
MAX_MERGED = 1 << 14

Leaf = TypeVar("Leaf")
Chain = tuple[Instances, ...]  # outermost first; the empty chain is one identity
Chains = dict[int, list[Chain]]  # by group


@dataclass
class Group(Generic[Leaf]):
    path: str
    leaves: list[Leaf] = field(default_factory=list)
    instances: list[tuple[int, Instances]] = field(default_factory=list)  # (group, group_from_instance)
    blur_scale: float = 1.0  # motion:blurScale of all leaves, which scales times relative to the frame


@dataclass(frozen=True)
class Arrangement:
    """Placements of groups: all of them in the world; and, where kept in two levels, those at the top and those inside."""

    world: Chains
    top: Chains
    inside: dict[int, Chains]  # placements inside each group that keeps its instances together
    cyclic: list[tuple[int, int]]  # instancings left out because a group contains itself


def merge_coincident(groups: list[Group[Leaf]], adds_up: Callable[[Leaf], bool]) -> dict[int, int]:
    """Remove instances placed exactly where another one of the same group is; return how many, by that group.

    Lights in one place add up, so groups with leaves that do are left as they are, and so are all groups that contain them.
    """
    holders: dict[int, list[int]] = {}
    for g, group in enumerate(groups):
        for child, _ in group.instances:
            holders.setdefault(child, []).append(g)
    lit = {g for g, group in enumerate(groups) if any(adds_up(leaf) for leaf in group.leaves)}
    queue = list(lit)
    while queue:
        new = set(holders.get(queue.pop(), ())) - lit
        lit |= new
        queue += new
    merged: dict[int, int] = {}
    for group in groups:
        by_child: dict[int, list[Instances]] = {}
        for child, some in group.instances:
            by_child.setdefault(child, []).append(some)
        fewer = {child: levels if child in lit else _distinct(levels) for child, levels in by_child.items()}
        group.instances = [(child, level) for child, levels in fewer.items() for level in levels]
        for child, levels in by_child.items():
            gone = sum(map(len, levels)) - sum(map(len, fewer[child]))
            if gone:
                merged[child] = merged.get(child, 0) + gone
    return merged


def _distinct(levels: list[Instances]) -> list[Instances]:
    """Return the levels without coincident instances, also across small levels such as those of one instancer each; moving
    levels stay."""
    if any_moves(levels):
        return levels
    if len(levels) > 1 and not any(level.primvars for level in levels) and sum(map(len, levels)) <= MAX_MERGED:
        rows = np.concatenate([level.rows(0, len(level)) for level in levels])
        return [without_coincident(MatrixInstances(rows, names=_names([(level,) for level in levels])))]
    return [without_coincident(level) for level in levels]


def count_of(chain: Chain) -> int:
    return math.prod(len(level) for level in chain)


def arrange(groups: list[Group[Leaf]], max_bytes: int | None) -> Arrangement:
    """Compute the placements of all groups, of which the first is the world; raise LimitError if instances take over
    `max_bytes`."""
    order, cyclic = _order(groups)
    graph = _Graph(groups, order, cyclic)
    kept = graph.grouping(MAX_FLAT_INSTANCES, None if max_bytes is None else max_bytes // INSTANCE_BYTES)
    _check_limit(groups, graph, kept, max_bytes)
    world = graph.chains(0, frozenset())
    if not kept:
        return Arrangement(world, world, {}, sorted(cyclic))
    top = graph.chains(0, kept)
    return Arrangement(world, top, {g: graph.chains(g, frozenset()) for g in sorted(kept)}, sorted(cyclic))


def at_instant(where: Arrangement, groups: list[Group[Leaf]], offset: float) -> Arrangement:
    """Return the arrangement frozen at a time, `offset` time codes after the frame."""

    def still(chains: Chains) -> Chains:
        return {g: [chain_at(chain, offset * groups[g].blur_scale) for chain in some] for g, some in chains.items()}

    return replace(
        where, world=still(where.world), top=still(where.top), inside={g: still(some) for g, some in where.inside.items()}
    )


class _Graph(Generic[Leaf]):
    """The instancing graph without the edges that close a cycle, parents before children."""

    def __init__(self, groups: list[Group[Leaf]], order: list[int], cyclic: set[tuple[int, int]]) -> None:
        self.order = order
        self.edges = {g: [(c, some) for c, some in groups[g].instances if (g, c) not in cyclic and len(some)] for g in order}
        self.has_leaves = {g: bool(groups[g].leaves) for g in order}
        self.below: dict[int, int] = {}  # instances in one instance of the group, multiplied out
        for g in reversed(order):
            self.below[g] = self.has_leaves[g] + sum(len(some) * self.below[c] for c, some in self.edges[g])

    def above(self, kept: frozenset[int]) -> dict[int, int]:
        """Return how often each group is placed in the world, without looking into the `kept` ones."""
        counts = dict.fromkeys(self.order, 0)
        counts[self.order[0]] = 1
        for g in self.order:
            if g not in kept:
                for child, some in self.edges[g]:
                    counts[child] += counts[g] * len(some)
        return counts

    def stored(self, kept: frozenset[int]) -> int:
        """Return the number of instances to store in both levels."""
        counts = self.above(kept)
        top = sum(counts[g] for g in self.order if g in kept or self.has_leaves[g])
        return top + sum(self.below[g] for g in kept)

    def grouping(self, max_flat: int, max_stored: int | None) -> frozenset[int]:
        """Return the groups to keep together: those that leave the fewest instances to store; none where that is not worth it.

        For every power of two, the outermost groups that contain at most that many instances are tried.
        """
        none: frozenset[int] = frozenset()
        flat = self.below[self.order[0]]
        fits = max_stored is None or flat <= max_stored
        if fits and flat <= max_flat:
            return none
        tried = [self._outermost(1 << bits) for bits in range(1, flat.bit_length())]
        best = min(tried, key=self.stored, default=none)
        fewest = self.stored(best)
        return best if (2 * fewest <= flat if fits else fewest < flat) else none

    def _outermost(self, most: int) -> frozenset[int]:
        small = {c for g in self.order for c, _ in self.edges[g] if self.below[g] > most and 1 < self.below[c] <= most}
        counts = self.above(frozenset(small))
        return frozenset(c for c in small if counts[c] > 1)

    def chains(self, start: int, kept: frozenset[int]) -> Chains:
        """Return the placements of the groups below `start` in it, without looking into the `kept` ones."""
        found: Chains = {start: [()]}
        for g in self.order:
            if g not in found or (g in kept and g != start):
                continue
            found[g] = _merged(found[g])
            for child, some in self.edges[g]:
                found.setdefault(child, []).extend(_extended(chain, some) for chain in found[g])
        return {g: _merged(some) for g, some in found.items()}


def _extended(chain: Chain, level: Instances) -> Chain:
    """Return a chain with one more level. A level of one instance is multiplied into the next one, unless it moves."""
    if chain and len(chain[-1]) == 1 and not chain[-1].primvars and not any_moves(chain[-1:]):
        name = "" if chain[-1].names is None else chain[-1].names.of(0)
        return (*chain[:-1], level.placed(chain[-1].rows(0, 1)[0], name))
    return (*chain, level)


def _merged(chains: list[Chain]) -> list[Chain]:
    """Return the chains with the small ones multiplied out into one, unless they carry primvars."""
    small = [c for c in chains if count_of(c) <= MAX_MERGED and not any(level.primvars for level in c)]
    if len(small) < 2:
        return chains
    whole: MatrixInstances
    if any(map(any_moves, small)):
        whole = replace(concatenated_levels(small), names=_names(small))
    else:
        whole = MatrixInstances(np.concatenate([rows for chain in small for rows in chunks(chain)]), names=_names(small))
    ids = {id(chain) for chain in small}
    return [(whole,), *(chain for chain in chains if id(chain) not in ids)]


def _names(some: list[Chain]) -> Names | None:
    """Return the names of all instances of some chains, in order; None where there are none."""
    if all(level.names is None for chain in some for level in chain):
        return None
    levels = [named_levels(chain) for chain in some]
    return texts([instance_name(each, row) for each, chain in zip(levels, some, strict=True) for row in range(count_of(chain))])


def _order(groups: list[Group[Leaf]]) -> tuple[list[int], set[tuple[int, int]]]:
    """Return the groups reachable from the world, parents before children, and the edges that close a cycle."""
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


def _check_limit(groups: list[Group[Leaf]], graph: _Graph[Leaf], kept: frozenset[int], max_bytes: int | None) -> None:
    stored = graph.stored(kept)
    if max_bytes is None or stored * INSTANCE_BYTES <= max_bytes:
        return
    counts = graph.above(kept)
    biggest = max(graph.order, key=lambda g: counts[g])
    raise LimitError(
        f"The stage has {graph.below[0]:,} instances, of which {stored:,} must be stored; they take about "
        f"{stored * INSTANCE_BYTES / 1e6:,.0f} MB, more than the limit of {max_bytes / 1e6:,.0f} MB.",
        where=groups[biggest].path,
        code="memory-limit",
    )
