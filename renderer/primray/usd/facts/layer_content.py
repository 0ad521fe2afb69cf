"""Content of one layer, opened without any other: the files that it names, and its prims with their arcs.

Composition would open what is named (so does UsdUtils.ComputeAllDependencies), so nothing is composed here. Asset paths are
those of all variants, time samples, arrays, clips and metadata; expressions are evaluated with the layer's own variables only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf, UsdUtils

from ...diagnostics import Diagnostics
from ...errors import StageOpenError
from ..opening.file_names import FileNames
from ..opening.stage import open_layer, usd_messages
from ..querying.guarded import FAILURES
from ..querying.stage_values import has_expression_variables, layer_default_prim

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


@dataclass
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
            paths,
            expressions,
            composition,
            has_variables,
            found.identifiers,
            sublayers,
            layer_default_prim(layer),
            found.root,
            found.depth,
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
