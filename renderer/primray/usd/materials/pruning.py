"""Removal of pattern nodes that no surface input reads, and concatenation of patterns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...description import Input, NodeOutput, Pattern, PatternInput, PatternNode


def pruned(nodes: Sequence[PatternNode], inputs: Mapping[str, Input]) -> tuple[Pattern | None, dict[str, Input]]:
    """Return the pattern without unused nodes, None where no input reads one, and the inputs with the new node numbers."""
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
    same = next((place for place, index in enumerate(order) if place != index), len(order))  # first node with a new number

    kept = [_moved(nodes[index], number) for index in order[same:]]
    made = {
        name: replace(found, source=NodeOutput(number[found.source.node], found.source.output))
        if isinstance(found, PatternInput)
        else found
        for name, found in inputs.items()
    }
    return Pattern((*nodes[:same], *kept)), made


def appended(pattern: Pattern | None, more: Pattern, reads: PatternInput) -> tuple[Pattern, PatternInput]:
    """Return two patterns as one, and the input that reads the second with its new node number."""
    if pattern is None:
        return more, reads
    first = len(pattern.nodes)
    number = {place: first + place for place in range(len(more.nodes))}
    nodes = (*pattern.nodes, *(_moved(node, number) for node in more.nodes))
    return Pattern(nodes), replace(reads, source=replace(reads.source, node=number[reads.source.node]))


def _moved(node: PatternNode, number: Mapping[int, int]) -> PatternNode:
    """Return a node with the numbers of the nodes that it reads replaced; the same object where it reads none."""
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
