"""Of a graph, the nodes that a surface's inputs read, numbered anew in their order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...description import Input, NodeOutput, Pattern, PatternInput, PatternNode


def pruned(nodes: Sequence[PatternNode], inputs: Mapping[str, Input]) -> tuple[Pattern | None, dict[str, Input]]:
    """The pattern, None where no input reads one, and the inputs with its numbers."""
    waiting = [found.source.node for found in inputs.values() if isinstance(found, PatternInput)]
    if not waiting:
        return None, dict(inputs)
    read: set[int] = set()
    while waiting:
        index = waiting.pop()
        if index not in read:
            read.add(index)
            waiting += [operand.node for _, operand in nodes[index].inputs if isinstance(operand, NodeOutput)]
    order = sorted(read)
    number = {index: place for place, index in enumerate(order)}
    same = next((place for place, index in enumerate(order) if place != index), len(order))  # so many stay as they are

    kept = [_moved(nodes[index], number) for index in order[same:]]
    made = {
        name: replace(found, source=NodeOutput(number[found.source.node], found.source.output))
        if isinstance(found, PatternInput)
        else found
        for name, found in inputs.items()
    }
    return Pattern((*nodes[:same], *kept)), made


def appended(pattern: Pattern | None, more: Pattern, reads: PatternInput) -> tuple[Pattern, PatternInput]:
    """Both graphs as one, and what reads the second."""
    if pattern is None:
        return more, reads
    first = len(pattern.nodes)
    number = {place: first + place for place in range(len(more.nodes))}
    nodes = (*pattern.nodes, *(_moved(node, number) for node in more.nodes))
    return Pattern(nodes), replace(reads, source=replace(reads.source, node=number[reads.source.node]))


def _moved(node: PatternNode, number: Mapping[int, int]) -> PatternNode:
    """As it is, where it reads no other."""
    for _, operand in node.inputs:
        if type(operand) is NodeOutput:
            break
    else:
        return node
    inputs = [
        (pair[0], NodeOutput(number[pair[1].node], pair[1].output)) if type(pair[1]) is NodeOutput else pair
        for pair in node.inputs
    ]
    return PatternNode(node.category, node.type, node.signature, tuple(inputs), node.path)
