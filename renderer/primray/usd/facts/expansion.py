"""Number of prims that a scene expands to, counted from its layers' arcs before USD composes what might never end.

Ten prims that each refer ten times to the next level are a thousand million prims nine levels down, in 3 kB. The count is an
estimate from above: sublayers and arcs add up, the largest variant counts, cycles end. Expanded instances are counted as the
renderer would place them, and separately the prims that USD itself would compose.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field

from .layer_content import Arc, LayerContent, Node

# (layer's name, asset path) -> the name of the layer that it leads to, or None if that is not there.
Resolve = Callable[[str, str], str | None]
_RECURSION = 60_000  # depth of prims and chains of arcs; plain Python frames, which take no C stack
_ENOUGH = 10**15


@dataclass
class Expansion:
    expanded: int  # prims, including those of each instance
    composed: int  # prims, each instanceable one counted once


@dataclass
class _Counter:
    layers: dict[str, LayerContent]
    resolve: Resolve
    known: dict[tuple[str, int], tuple[int, int]] = field(default_factory=dict)
    entered: set[tuple[str, int]] = field(default_factory=set)


def expansion(layers: dict[str, LayerContent], entry: str, resolve: Resolve) -> Expansion | None:
    """Return the counts for the layer `entry`; None where they are unknown: too many prims in a layer, or arcs too deep."""
    if any(content.root is None for content in layers.values()):
        return None
    counter = _Counter(layers, resolve)
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(_RECURSION)
    try:
        expanded = composed = 0
        for name in _stack(counter, entry):
            root = layers[name].root
            if root is not None:
                of_layer = _children(counter, name, root)
                expanded, composed = expanded + of_layer[0], composed + of_layer[1]
    except RecursionError:
        return None
    finally:
        sys.setrecursionlimit(before)
    return Expansion(expanded, composed)


def _stack(counter: _Counter, name: str) -> list[str]:
    """Return the layer and all its sublayers, once each."""
    found = [name] if name in counter.layers else []
    for known in found:
        for sublayer in counter.layers[known].sublayers:
            leads_to = counter.resolve(known, sublayer)
            if leads_to is not None and leads_to in counter.layers and leads_to not in found:
                found.append(leads_to)
    return found


def _prim(counter: _Counter, name: str, node: Node) -> tuple[int, int]:
    """Return the counts of a prim and everything below it."""
    key = (name, id(node))
    if key in counter.known:
        return counter.known[key]
    if key in counter.entered:
        return (0, 0)
    counter.entered.add(key)
    expanded, composed = _children(counter, name, node)
    for alternatives in node.variants:
        most = (1, 1)  # a variant is not a prim itself
        for alternative in alternatives:
            most = max(most, _prim(counter, name, alternative))
        expanded, composed = expanded + most[0] - 1, composed + most[1] - 1
    for arc in node.arcs:
        of_arc = _target(counter, name, arc)
        expanded, composed = expanded + of_arc[0], composed + of_arc[1]
    counter.entered.discard(key)
    shared = node.is_instanceable and bool(node.arcs)
    result = (min(expanded + 1, _ENOUGH), 1 if shared else min(composed + 1, _ENOUGH))
    counter.known[key] = result
    return result


def _children(counter: _Counter, name: str, node: Node) -> tuple[int, int]:
    expanded = composed = 0
    for child in node.children.values():
        of_child = _prim(counter, name, child)
        expanded, composed = expanded + of_child[0], composed + of_child[1]
    return min(expanded, _ENOUGH), min(composed, _ENOUGH)


def _target(counter: _Counter, name: str, arc: Arc) -> tuple[int, int]:
    """Return the counts that an arc brings below its prim, from all layers of the stack that it leads to."""
    leads_to = counter.resolve(name, arc.asset) if arc.asset else name
    if leads_to is None or leads_to not in counter.layers:
        return (0, 0)
    stack = _stack(counter, leads_to)
    path = arc.path
    if path is None:
        defaults = [counter.layers[layer].default_prim for layer in stack]
        path = next((f"/{default.strip('/')}" for default in defaults if default), None)
    expanded = composed = 0
    for layer in stack if path is not None else ():
        node = _at(counter.layers[layer].root, path or "")
        if node is not None:
            found = _prim(counter, layer, node)
            expanded, composed = expanded + max(0, found[0] - 1), composed + max(0, found[1] - 1)
    return expanded, composed


def _at(root: Node | None, path: str) -> Node | None:
    node = root
    for name in path.strip("/").split("/"):
        node = node.children.get(name) if node is not None else None
    return node
