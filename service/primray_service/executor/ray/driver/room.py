"""How many chunks fit on the nodes, and what each may use. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

CORES = 8  # of a chunk, where nobody says otherwise: as many as a slot has on one machine


@dataclass(frozen=True)
class Resources:
    """Of a node, as Ray has them."""

    cores: int
    memory_bytes: int


@dataclass(frozen=True)
class Room:
    cores: int  # of a chunk
    memory_bytes: int  # of a chunk
    slots: Mapping[str, int]  # by node

    @property
    def total(self) -> int:
        return sum(self.slots.values())


def room(nodes: Mapping[str, Resources], cores: int | None, memory_bytes: int) -> Room:
    """`cores`: that a chunk takes (None: CORES, or all of the smallest node's if it has fewer); `memory_bytes`: the most that
    it may use; less where a node would not have it for each of its chunks."""
    each = cores or min([CORES, *(node.cores for node in nodes.values() if node.cores)])
    slots = {name: node.cores // each for name, node in nodes.items()}
    shares = [nodes[name].memory_bytes // count for name, count in slots.items() if count]
    return Room(each, min([memory_bytes, *shares]), slots)


def selector(labels: Mapping[str, str], refused: Sequence[str]) -> dict[str, str]:
    """Ray's label selector for the nodes that may get a chunk: those with these labels, but for some."""
    ours = dict(labels)
    if refused:
        ours["ray.io/node-id"] = f"!in({', '.join(refused)})"
    return ours
