"""Capacity of the nodes: how many chunks fit, and what each may use. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

CORES = 8  # default for a chunk: as many as a slot has on one machine


@dataclass(frozen=True)
class Resources:
    """Resources of a node, as Ray reports them."""

    cores: int
    memory_bytes: int


@dataclass(frozen=True)
class Room:
    cores: int  # per chunk
    memory_bytes: int  # per chunk
    slots: Mapping[str, int]  # by node

    @property
    def total(self) -> int:
        return sum(self.slots.values())


def room(nodes: Mapping[str, Resources], cores: int | None, memory_bytes: int) -> Room:
    """Return the room on the nodes. `cores`: for each chunk (None: CORES, or all of the smallest node's if it has fewer);
    `memory_bytes`: the most for each chunk; less if a node could not give it to each of its chunks."""
    each = cores or min([CORES, *(node.cores for node in nodes.values() if node.cores)])
    slots = {name: node.cores // each for name, node in nodes.items()}
    shares = [nodes[name].memory_bytes // count for name, count in slots.items() if count]
    return Room(each, min([memory_bytes, *shares]), slots)


def selector(labels: Mapping[str, str], refused: Sequence[str]) -> dict[str, str]:
    """Return Ray's label selector for nodes that may get a chunk: those with these labels, except for refused ones."""
    ours = dict(labels)
    if refused:
        ours["ray.io/node-id"] = f"!in({', '.join(refused)})"
    return ours
