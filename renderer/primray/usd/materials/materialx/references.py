"""References of a stage to MaterialX documents, redirected to layers that are made from the documents.

USD has no file format for .mtlx, and a stage's layers may be shared with other stages. So layers that reference documents are
copied, as are the layers that reference those, up to the root: the stage is composed of the copies.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

from pxr import Ar, Sdf, Usd

from ....diagnostics import Diagnostics
from ....errors import AssetError
from ...stage.messages import error_text
from ...stage.metadata import asset_of_expression, authored_meters_per_unit, usable_length
from .documents import read_document
from .layer_writing import ROOT
from .look_effects import LookEffects, mark_looks, write_effects
from .looks import write_looks
from .materials import write_materials
from .node_graphs import NodeGraphs, own
from .substitute_layers import anchor, is_document, is_substitute, new_layer

_kept_open: dict[str, list[Sdf.Layer]] = {}  # by root layer: layers kept open for the stage's other variants and payloads


@dataclass
class _Record:
    """Source of a substitute layer: a document or a layer, and the asset paths replaced in the layer's copy."""

    source: str
    updates: dict[str, str] | None = None  # None for documents
    meters_per_unit: float = 1.0  # metersPerUnit of the stage for which a document was read
    effects: dict[Sdf.Path, LookEffects] = field(default_factory=dict)  # effects of a document's looks


_records: dict[str, _Record] = {}  # by identifier of the substitute layer


def refers_to_documents(stage: Usd.Stage) -> bool:
    """Return whether the stage has composition errors about MaterialX documents."""
    return any(".mtlx" in error_text(error).lower() for error in stage.GetCompositionErrors())


def is_format_message(message: str) -> bool:
    """Return whether USD's message only says that it has no file format for MaterialX.

    The effects of that are reported from the stage's composition errors.
    """
    return "Cannot determine file format" in message and ".mtlx" in message.lower()


class Redirection:
    """Substitute layers of one stage."""

    def __init__(self) -> None:
        self._copies: dict[str, Sdf.Layer] = {}  # by the original layer's identifier
        self._documents: dict[str, Sdf.Layer | None] = {}  # by resolved path; None: unreadable
        self._meters_per_unit = 1.0

    def of(self, layer: Sdf.Layer) -> Sdf.Layer:
        return self._copies.get(str(layer.identifier), layer)

    def redirect(self, stage: Usd.Stage, diagnostics: Diagnostics) -> bool:
        """Redirect references to substitute layers; return whether there were any, so that the stage must be composed again."""
        self._meters_per_unit = usable_length(authored_meters_per_unit(stage))
        layers = [layer for layer in stage.GetUsedLayers() if layer]
        named = {layer: _dependencies(layer, stage) for layer in layers}
        changes: dict[Sdf.Layer, dict[str, Sdf.Layer]] = {}
        for layer, paths in named.items():
            for authored, path in paths.items():
                made = self._document(layer, path, diagnostics) if is_document(path) else None
                if made is not None:
                    changes.setdefault(layer, {})[authored] = made
        if not changes:
            return False
        for layer in _leading_to(set(changes), named):
            changes.setdefault(layer, {})
            if not is_substitute(layer):
                self._copies[str(layer.identifier)] = _copy(layer)
        for layer, updates in changes.items():
            self._update(layer, named[layer], updates)
        _keep_open(self.of(stage.GetRootLayer()), [*self._copies.values(), *filter(None, self._documents.values())])
        return True

    def apply_looks(self, stage: Usd.Stage) -> None:
        """Author the effects of looks on prims of the composed stage."""
        identifiers = [str(layer.identifier) for layer in self._documents.values() if layer]
        effects = {name: _records[name].effects for name in identifiers if _records[name].effects}
        if effects:
            write_effects(stage, effects)

    def _update(self, layer: Sdf.Layer, paths: dict[str, str], documents: dict[str, Sdf.Layer]) -> None:
        copy = self.of(layer)
        for authored, path in paths.items():
            other = _found(layer, path)
            target = documents.get(authored) or (self._copies.get(str(other.identifier)) if other else None)
            if target is not None:
                copy.UpdateCompositionAssetDependency(authored, target.identifier)
                record = _records.get(str(copy.identifier))
                if record is not None and record.updates is not None:
                    record.updates[authored] = str(target.identifier)
        if copy is not layer:
            anchor(copy, str(layer.identifier))

    def _document(self, layer: Sdf.Layer, path: str, diagnostics: Diagnostics) -> Sdf.Layer | None:
        """Return the substitute layer of a document, None where it does not exist or cannot be read (reported)."""
        resolved = str(layer.ComputeAbsolutePath(path))
        if resolved not in self._documents:
            try:
                there = Ar.GetResolver().Resolve(resolved)  # if not, the stage's composition error is reported
                self._documents[resolved] = layer_of_document(resolved, self._meters_per_unit) if there else None
            except AssetError as error:
                self._documents[resolved] = None
                diagnostics.add(error.code, "", f"{error.where}: {error.message}.")
        return self._documents[resolved]


def layer_of_document(path: str, meters_per_unit: float = 1.0) -> Sdf.Layer:
    """Return a substitute layer for the document at a resolved path, lengths in the stage's unit; AssetError if unreadable."""
    layer = new_layer(path)
    record = _Record(path, meters_per_unit=meters_per_unit)
    _write_document(layer, record)
    _records[str(layer.identifier)] = record
    return layer


def rebuild_layers(files: Collection[str]) -> None:
    """Rebuild the substitute layers of these files (absolute paths) from their current content; AssetError if unreadable."""
    any_document = any(is_document(file) for file in files)  # documents may include each other
    for identifier, record in list(_records.items()):
        layer = Sdf.Layer.Find(identifier)
        if not layer:
            del _records[identifier]
        elif record.updates is None and (any_document or _file(record.source) in files):
            layer.Clear()
            _write_document(layer, record)
        elif record.updates is not None and _file(record.source) in files:
            layer.TransferContent(Sdf.Layer.FindOrOpen(record.source))
            for authored, target in record.updates.items():
                layer.UpdateCompositionAssetDependency(authored, target)
            anchor(layer, record.source)


def _file(path: str) -> str:
    return os.path.abspath(str(Ar.SplitPackageRelativePathOuter(path)[0]))


def _write_document(layer: Sdf.Layer, record: _Record) -> None:
    """Fill an empty substitute layer from its document."""
    path = record.source
    document = read_document(path)
    try:
        record.effects = write_layer(document, layer, record.meters_per_unit)
    except Exception as error:  # inconsistent documents raise exceptions of any class
        raise AssetError(f"it cannot be converted to a layer: {error}", where=path, code="materialx-document") from None
    anchor(layer, path)


def _keep_open(root: Sdf.Layer, layers: list[Sdf.Layer]) -> None:
    for identifier in [identifier for identifier in _kept_open if Sdf.Layer.Find(identifier) is None]:
        del _kept_open[identifier]
    _kept_open[str(root.identifier)] = [layer for layer in layers if layer != root]


def _dependencies(layer: Sdf.Layer, stage: Usd.Stage) -> dict[str, str]:
    """Return the sublayers, references and payloads of a layer: authored paths, and the same with expressions evaluated."""
    return {path: asset_of_expression(path, layer, stage) for path in layer.GetCompositionAssetDependencies() if path}


def _found(layer: Sdf.Layer, path: str) -> Sdf.Layer | None:
    return Sdf.Layer.FindRelativeToLayer(layer, path) if path else None


def _leading_to(layers: set[Sdf.Layer], named: dict[Sdf.Layer, dict[str, str]]) -> set[Sdf.Layer]:
    """Return these layers, and those that name them, directly or indirectly."""
    namers: dict[Sdf.Layer, set[Sdf.Layer]] = {}
    for layer, paths in named.items():
        for path in paths.values():
            other = _found(layer, path)
            if other:
                namers.setdefault(other, set()).add(layer)
    found, waiting = set(layers), list(layers)
    while waiting:
        for namer in namers.get(waiting.pop(), set()) - found:
            found.add(namer)
            waiting.append(namer)
    return found


def _copy(layer: Sdf.Layer) -> Sdf.Layer:
    made = new_layer(str(layer.identifier))
    made.TransferContent(layer)
    _records[str(made.identifier)] = _Record(str(layer.identifier), {})
    return made


def write_layer(document: Any, layer: Sdf.Layer, meters_per_unit: float) -> dict[Sdf.Path, LookEffects]:
    """Write a document to an empty layer, for a stage with this metersPerUnit.

    Returns what its looks do beside binding materials, by the paths of their variants.
    """
    effects: dict[Sdf.Path, LookEffects] = {}
    with Sdf.ChangeBlock():
        space = document.getActiveColorSpace()
        if space:
            layer.pseudoRoot.SetInfo("customLayerData", {"colorSpace": space})
        graphs = NodeGraphs(layer, document, meters_per_unit)
        graphs.of_definitions()
        write_materials(layer, document, graphs)
        if own(document, "look"):
            effects = write_looks(layer, document, graphs)
            mark_looks(layer, effects)
        if layer.GetPrimAtPath(ROOT):
            layer.pseudoRoot.SetInfo("defaultPrim", ROOT.name)
    return effects
