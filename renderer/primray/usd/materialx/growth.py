"""Size of a document's graphs with all graphs that they refer to, checked before USD composes that many prims."""

from __future__ import annotations

from typing import Any

MOST = 100_000  # nodes of one expanded graph


def fault(graphs: dict[str, Any], definitions: set[str]) -> str:
    """Return what is wrong with a document's graphs: one refers to itself, or exceeds MOST nodes; "" if nothing is."""
    holds = {name: _held(graph, graphs, definitions) for name, graph in graphs.items()}
    sizes: dict[str, int] = {}
    for first in graphs:
        waiting = [(first, iter(holds[first]))]
        above = {first}
        while waiting:
            name, others = waiting[-1]
            other = next((o for o in others if o not in sizes), None)
            if other is None:
                sizes[name] = len(graphs[name].getNodes()) + sum(sizes[o] for o in holds[name])
                waiting.pop()
                above.discard(name)
                if sizes[name] > MOST:
                    return f"its graph {name} has more than {MOST:,} nodes when it is expanded"
            elif other in above:
                return f"its graph {other} refers to itself"
            else:
                above.add(other)
                waiting.append((other, iter(holds[other])))
    return ""


def _held(graph: Any, graphs: dict[str, Any], definitions: set[str]) -> list[str]:
    """Return the names of the document's graphs that a graph refers to, once per reference: by nodes and by inputs."""
    found = []
    for node in graph.getNodes():
        definition = node.getNodeDef()
        if definition is not None and definition.getName() in definitions:
            implementation = definition.getImplementation()
            if implementation is not None and implementation.getName() in graphs:
                found.append(implementation.getName())
    named: set[str] = set()
    for element in (graph, *graph.getNodes()):
        named |= {i.getAttribute("nodegraph") for i in element.getInputs()}
    return found + [name for name in sorted(named) if name in graphs and name != graph.getName()]
