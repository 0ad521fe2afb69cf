"""Content of one layer, opened without any other: the files that it names, its prims with their composition arcs, how many
prims these expand to, and how deep its text is nested.

Composing a layer opens the files that it names (as UsdUtils.ComputeAllDependencies does), so nothing is composed here. Asset
paths are those of all variants, time samples, arrays, clips and metadata; expressions are evaluated with the layer's own
variables only.

Ten prims, each of which references the next one ten times, are a billion prims in a file of 3 kB. An upper bound of the number
is computed before USD composes what might never end: sublayers and arcs are added, a variant set counts as its largest variant,
and a cycle is cut where it closes.

The depth of nested brackets is measured before USD's parser reads the text: the parser recurses, and 50,000 nested dictionaries
crash the process (usd-core 26.11, a stack of 8 MB). Brackets in strings, comments, asset paths and expressions do not count.
Time is linear in the text, without recursion.
"""

from __future__ import annotations

import mmap
import os
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, UsdUtils

from ...diagnostics import Diagnostics
from ...errors import StageOpenError
from ..stage.messages import FileNames
from ..stage.metadata import has_expression_variables, layer_default_prim
from ..stage.open import open_layer, usd_messages
from ..stage.reads import FAILURES

# Tokens whose brackets do not nest, longer delimiters first; an unclosed one extends to the end of its line or of the text,
# as in the parser.
_QUOTED = re.compile(
    rb'"""(?:[^\\]|\\.)*?(?:"""|\Z)' + rb"|'''(?:[^\\]|\\.)*?(?:'''|\Z)"
    rb'|"(?:[^"\\\n\r]|\\.)*+"?' + rb"|'(?:[^'\\\n\r]|\\.)*+'?"
    rb"|@@@.*?(?:@@@|\Z)|@[^@\n\r]*@?|`[^`\n\r]*`?|\#[^\n\r]*|//[^\n\r]*|/\*.*?(?:\*/|\Z)",
    re.DOTALL,
)
_OPEN, _CLOSE = b"{[(", b"}])"
_BRACKET = re.compile(rb"[][{}()]")
_LONG = 4096  # bytes between quotations above which numpy counts
_PIECE = 1 << 20
_STEP = np.zeros(256, np.int8)
_STEP[list(_OPEN)] = 1
_STEP[list(_CLOSE)] = -1


def nesting_depth(path: str | os.PathLike[str], most: int, start: int = 0, size: int | None = None) -> int:
    """Return the deepest nesting in a text file or in a stretch of one; counting ends where it is above `most`."""
    if os.path.getsize(path) == 0:
        return 0
    with (
        Path(path).open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped,
        memoryview(mapped) as whole,
        whole[start : None if size is None else start + size] as text,
    ):
        return nesting_of(text, most)


def nesting_of(text: bytes | memoryview, most: int) -> int:
    depth = deepest = at = 0
    for quoted in _QUOTED.finditer(text):
        depth, deepest = _count(text, at, quoted.start(), depth, deepest)
        at = quoted.end()
        if deepest > most:
            return deepest
    return _count(text, at, len(text), depth, deepest)[1]


def _count(text: bytes | memoryview, start: int, end: int, depth: int, deepest: int) -> tuple[int, int]:
    """Return the depth behind a stretch without quotations, and the deepest so far."""
    if end - start < _LONG:
        for bracket in _BRACKET.findall(text[start:end]):
            depth += 1 if bracket in _OPEN else -1
            deepest = max(deepest, depth)
        return depth, deepest
    for piece in range(start, end, _PIECE):
        steps = _STEP[np.frombuffer(text[piece : min(piece + _PIECE, end)], np.uint8)]
        depths = depth + np.cumsum(steps, dtype=np.int64)
        depth, deepest = int(depths[-1]), max(deepest, int(depths.max()))
    return depth, deepest


# Prims whose arcs are read; a layer that has more is not a small text that expands to a large scene.
MOST_NODES = 20_000
DAMAGED = "damaged-layer"  # a layer that USD opens nevertheless
_FORMAT_ARGUMENTS = ":SDF_FORMAT_ARGS:"


@dataclass(frozen=True)
class Arc:
    """A reference, payload, inherit or specialize; `asset` is "" for the same layer stack, `path` None for a default prim."""

    asset: str
    path: str | None


@dataclass
class Node:
    """A prim spec: its children by name, its arcs, and its variants by set."""

    children: dict[str, Node] = field(default_factory=dict)
    arcs: list[Arc] = field(default_factory=list)
    variants: list[list[Node]] = field(default_factory=list)
    is_instanceable: bool = False


@dataclass(kw_only=True)
class LayerContent:
    asset_paths: list[str]  # everything that names a file, once each, in order
    expressions: list[str]  # as written between backticks; their values with the layer's own variables are in asset_paths
    composition: set[str]  # the asset paths that lead to other layers
    has_variables: bool  # it has expression variables: expressions may evaluate differently when composed
    identifiers: set[str]  # assetInfo identifiers, which name files that USD does not open
    sublayers: list[str]
    default_prim: str | None
    root: Node | None  # None: too many prims
    depth: int


def layer_content(path: str, name: str) -> LayerContent:
    """Read a layer; raise StageOpenError at `name` with USD's words where it cannot be opened.

    The error has the code DAMAGED where what the layer names cannot be read.
    """
    with usd_messages(Diagnostics(FileNames(path).in_text)):
        try:
            layer = open_layer(path, Sdf.Layer.OpenAsAnonymous)
        except StageOpenError as error:
            error.where = name
            raise
        found = _tree_of(layer, name)
        sublayers = [_without_arguments(path) for path in layer.subLayerPaths]
        has_variables = has_expression_variables(layer)
        composition = {_without_arguments(path) for path in layer.GetCompositionAssetDependencies()}
        paths, expressions = _asset_paths(layer, name)
        return LayerContent(
            asset_paths=paths,
            expressions=expressions,
            composition=composition,
            has_variables=has_variables,
            identifiers=found.identifiers,
            sublayers=sublayers,
            default_prim=layer_default_prim(layer),
            root=found.root,
            depth=found.depth,
        )


def _tree_of(layer: Sdf.Layer, name: str) -> _Tree:
    """Return the layer's tree; raise StageOpenError where fields of its prims have wrong types."""
    try:
        return _tree(layer)
    except FAILURES:
        raise _damaged(name) from None


def _damaged(name: str) -> StageOpenError:
    return StageOpenError("The layer is damaged: it has invalid names, fields or prims.", where=name, code=DAMAGED)


def _asset_paths(layer: Sdf.Layer, name: str) -> tuple[list[str], list[str]]:
    """Return asset paths and expressions; raise StageOpenError where USD passes something that is not text."""
    found: dict[str, None] = {}

    def keep(path: str) -> str:
        found.setdefault(path)
        return path

    try:
        for path in layer.GetCompositionAssetDependencies():
            keep(path)
        UsdUtils.ModifyAssetPaths(layer, keep)
    except FAILURES:
        raise _damaged(name) from None
    plain = [_without_arguments(path) for path in found if path and not path.startswith("`")]
    return list(dict.fromkeys(plain)), [path.strip("`") for path in found if path.startswith("`")]


def _without_arguments(path: str) -> str:
    return path.partition(_FORMAT_ARGUMENTS)[0]


@dataclass
class _Tree:
    root: Node | None = None
    identifiers: set[str] = field(default_factory=set)
    depth: int = 0


def _tree(layer: Sdf.Layer) -> _Tree:
    """Read the layer's prims without recursion: a binary layer may nest them arbitrarily deep."""
    tree = _Tree()
    root = Node()
    waiting: list[tuple[Any, Node, int]] = [(layer.pseudoRoot, root, 0)]
    count = 0
    while waiting:
        spec, node, depth = waiting.pop()
        tree.depth = max(tree.depth, depth)
        if depth:
            _read(spec, node, tree.identifiers)
        children = spec.nameChildren
        count += len(children)
        if count > MOST_NODES:
            return tree
        waiting += [(child, _child(node, child.name), depth + 1) for child in children]
        for variant, alternative in _variants(spec, node):
            waiting.append((variant, alternative, depth))
            count += 1
    tree.root = root
    return tree


def _child(node: Node, name: str) -> Node:
    return node.children.setdefault(name, Node())


def _variants(spec: Sdf.PrimSpec, node: Node) -> Iterator[tuple[Sdf.PrimSpec, Node]]:
    for variant_set in spec.variantSets.values() if spec.HasInfo("variantSetNames") else ():
        alternatives: list[Node] = []
        node.variants.append(alternatives)
        for variant in variant_set.variantList:
            alternatives.append(Node())
            yield variant.primSpec, alternatives[-1]


def _read(spec: Sdf.PrimSpec, node: Node, identifiers: set[str]) -> None:
    node.is_instanceable = bool(spec.HasInfo("instanceable") and spec.instanceable)
    for key, items in (("references", "referenceList"), ("payload", "payloadList")):
        if spec.HasInfo(key):
            for arc in getattr(spec, items).GetAppliedItems():
                node.arcs.append(Arc(_without_arguments(arc.assetPath), str(arc.primPath) or None))
    for key, items in (("inheritPaths", "inheritPathList"), ("specializes", "specializesList")):
        if spec.HasInfo(key):
            node.arcs += [Arc("", str(path)) for path in getattr(spec, items).GetAppliedItems()]
    if spec.HasInfo("assetInfo"):
        identifier = spec.assetInfo.get("identifier")
        if isinstance(identifier, Sdf.AssetPath):
            identifiers.add(identifier.path)


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
        for name in _layer_stack(counter, entry):
            root = layers[name].root
            if root is not None:
                of_layer = _count_children(counter, name, root)
                expanded, composed = expanded + of_layer[0], composed + of_layer[1]
    except RecursionError:
        return None
    finally:
        sys.setrecursionlimit(before)
    return Expansion(expanded, composed)


def _layer_stack(counter: _Counter, name: str) -> list[str]:
    """Return the layer and all its sublayers, once each."""
    found = [name] if name in counter.layers else []
    for known in found:
        for sublayer in counter.layers[known].sublayers:
            leads_to = counter.resolve(known, sublayer)
            if leads_to is not None and leads_to in counter.layers and leads_to not in found:
                found.append(leads_to)
    return found


def _count_prim(counter: _Counter, name: str, node: Node) -> tuple[int, int]:
    """Return the counts of a prim and everything below it."""
    key = (name, id(node))
    if key in counter.known:
        return counter.known[key]
    if key in counter.entered:
        return (0, 0)
    counter.entered.add(key)
    expanded, composed = _count_children(counter, name, node)
    for alternatives in node.variants:
        most = (1, 1)  # a variant is not a prim itself
        for alternative in alternatives:
            most = max(most, _count_prim(counter, name, alternative))
        expanded, composed = expanded + most[0] - 1, composed + most[1] - 1
    for arc in node.arcs:
        of_arc = _count_target(counter, name, arc)
        expanded, composed = expanded + of_arc[0], composed + of_arc[1]
    counter.entered.discard(key)
    shared = node.is_instanceable and bool(node.arcs)
    result = (min(expanded + 1, _ENOUGH), 1 if shared else min(composed + 1, _ENOUGH))
    counter.known[key] = result
    return result


def _count_children(counter: _Counter, name: str, node: Node) -> tuple[int, int]:
    expanded = composed = 0
    for child in node.children.values():
        of_child = _count_prim(counter, name, child)
        expanded, composed = expanded + of_child[0], composed + of_child[1]
    return min(expanded, _ENOUGH), min(composed, _ENOUGH)


def _count_target(counter: _Counter, name: str, arc: Arc) -> tuple[int, int]:
    """Return the counts that an arc brings below its prim, from all layers of the stack that it leads to."""
    leads_to = counter.resolve(name, arc.asset) if arc.asset else name
    if leads_to is None or leads_to not in counter.layers:
        return (0, 0)
    stack = _layer_stack(counter, leads_to)
    path = arc.path
    if path is None:
        defaults = [counter.layers[layer].default_prim for layer in stack]
        path = next((f"/{default.strip('/')}" for default in defaults if default), None)
    expanded = composed = 0
    for layer in stack if path is not None else ():
        node = _node_at(counter.layers[layer].root, path or "")
        if node is not None:
            found = _count_prim(counter, layer, node)
            expanded, composed = expanded + max(0, found[0] - 1), composed + max(0, found[1] - 1)
    return expanded, composed


def _node_at(root: Node | None, path: str) -> Node | None:
    node = root
    for name in path.strip("/").split("/"):
        node = node.children.get(name) if node is not None else None
    return node
