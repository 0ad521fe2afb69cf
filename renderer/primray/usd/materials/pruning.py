"""Of a graph, the nodes that a surface's inputs read, numbered anew in their order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...description import Input, NodeOutput, Operand, Pattern, PatternInput, PatternNode


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
    number = {index: place for place, index in enumerate(sorted(read))}

    def moved(operand: Operand) -> Operand:
        return NodeOutput(number[operand.node], operand.output) if isinstance(operand, NodeOutput) else operand

    kept = tuple(
        PatternNode(n.category, n.type, n.signature, tuple([(name, moved(operand)) for name, operand in n.inputs]), n.path)
        for n in map(nodes.__getitem__, number)
    )
    made = {
        name: replace(found, source=NodeOutput(number[found.source.node], found.source.output))
        if isinstance(found, PatternInput)
        else found
        for name, found in inputs.items()
    }
    return Pattern(kept), made
