"""The check of a scene: it is examined once, so that jobs fail early and the page knows what to offer.

First every layer of an upload is examined alone (its asset paths, its depth, the number of prims it expands to), then the
composed stage. A Problem ends the check and refuses the scene; what can be rendered anyway is a warning. A stage on shared
storage is examined likewise: its references stay in its shared root, and it can be composed; messages name the layer at
fault.

It is the sandbox that keeps hostile scenes in: a worker sees only its job's folder, or only the root of shared storage. The
check only makes clear messages of what it finds.
"""

from __future__ import annotations

import os
import posixpath
from collections.abc import Collection, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Protocol

from primray.diagnostic_codes import CODES, Kind
from primray.errors import AssetError, StageOpenError
from primray.usd import dependencies
from primray.usd.inspect.layer_content import DAMAGED as DAMAGED_LAYER
from primray.usd.inspect.layer_content import LayerContent, expansion, layer_content, nesting_depth
from primray.usd.inspect.scene_facts import MissingLayer, SceneFacts, layer_file, scene_facts
from primray.usd.materials.materialx.documents import names_in
from primray.usd.materials.materialx.substitute_layers import is_document

from ..limits import Limits
from ..problems import Problem
from ..scenes.recognize import candidates, choose, without_layers
from ..scenes.recognize import layers as layers_of
from .package import (
    SCHEME,
    Container,
    File,
    Found,
    find,
    read_file,
    read_folder,
    refuse_expression,
    scene_layers,
    split_package,
)

SHARED = "shared"
MOST_WARNINGS = 300
MOST_LISTED = 2_000  # files
MOST_COMPOSED = 10_000_000  # prims: USD composes this many in some minutes
# Exceptions from USD's Python for a binary layer with damaged tables: names that are not text, prims that are None.
DAMAGED = (UnicodeDecodeError, AttributeError)


class Sends(Protocol):
    def send(self, at: str, **members: Any) -> None: ...

    def leave(self, at: str, **members: Any) -> None: ...


def check_scene(command: Mapping[str, Any], job: Path, out: Path, channel: Sends) -> None:
    """Check a scene and send its warnings, then its `facts`; raise Problem if the scene is refused."""
    check = _Check(command, job, channel)
    if command["kind"] == SHARED:
        check_shared(command, channel)
        return
    channel.send("phase", phase="opening")
    facts = check.run()
    channel.leave("facts", **facts)


class _Check:
    def __init__(self, command: Mapping[str, Any], job: Path, channel: Sends) -> None:
        self.limits = limits_of(command.get("limits") or {})
        self.asked: str | None = command.get("entry")
        self.job = job
        self.channel = channel
        self.warnings = Warnings(channel)
        place = job / command["file"]
        self.is_package = command["kind"] == "zip"
        self.root = place if self.is_package else place.parent  # file names are relative to this
        self.files = read_folder(place, self.limits) if self.is_package else read_file(place, self.limits)
        self.contents: dict[str, LayerContent] = {}
        self.unreadable: dict[str, StageOpenError] = {}  # by layer; composition continues without those that are not roots
        self.not_uploaded: list[tuple[str, str]] = []  # layers and paths in them
        self.layers_found: dict[str, tuple[Container, File]] = {}
        self.named: set[str | None] = set()  # layers that others refer to
        self.leads_to: dict[tuple[str, str], str | None] = {}

    def run(self) -> dict[str, Any]:
        self._read_layers()
        entries = self._readable(self._entries())
        entry = choose(self.asked, entries, layers_of(self.files.files)) if self.asked or len(entries) == 1 else None
        self._warn_of_programs()
        self._resolve_all()
        self._warn_of_unreadable()
        package = self._package_facts(entries, entry)
        if entry is None:
            self._warn(
                "ambiguous-entry", "", f"The package has {len(entries)} layers that can be its root; jobs must name one."
            )
            self._warn_of_not_uploaded(frozenset())
            return package
        self._refuse_bombs(entry)
        stage = self._compose(entry)
        return {**package, **stage.facts}

    def _read_layers(self) -> None:
        layers = scene_layers(self.files)
        if not layers:
            raise without_layers(sorted(self.files.files))
        if len(layers) > self.limits.layers:
            raise too_large("layers", len(layers), self.limits.layers)
        for container, file in layers:
            name = container.shown(file.name)
            self._refuse_deep_text(name, file)
            self.layers_found[name] = (container, file)
            try:
                content = layer_content(str(self.root / name), name)
            except StageOpenError as error:
                if error.code == DAMAGED_LAYER:  # USD would open it, but its references cannot be listed
                    raise
                self.unreadable[name] = error
                continue
            except DAMAGED:
                raise damaged(name) from None
            if content.depth > self.limits.prim_depth:
                raise too_large("nested prims", content.depth, self.limits.prim_depth, layer=name)
            self.contents[name] = content

    def _refuse_deep_text(self, name: str, file: File) -> None:
        """Refuse deeply nested text before USD's parser sees it, which recurses."""
        if file.kind != "usda":
            return
        depth = nesting_depth(file.path, self.limits.prim_depth, file.at, file.bytes)
        if depth > self.limits.prim_depth:
            raise too_large("nested brackets", depth, self.limits.prim_depth, layer=name)

    def _entries(self) -> list[str]:
        """Return the outermost layers that no other layer refers to; all of them if each is referred to by another."""
        outermost = candidates(self.files.files)
        named = {
            found.name
            for name in self.contents
            for path in self.contents[name].asset_paths
            if (found := self._find(name, split_package(path)[0])) is not None and found.name != name
        }
        named |= {name.partition("[")[0] for name in named}
        return [name for name in outermost if name not in named] or outermost

    def _readable(self, entries: list[str]) -> list[str]:
        """Return the entries that can be opened; raises the error of a requested one, or of the first if none can be."""
        broken = {
            entry: self.unreadable[root] for entry in entries if (root := _root_layer(self.files, entry)) in self.unreadable
        }
        left = [entry for entry in entries if entry not in broken]
        error = broken.get(self.asked or "") or (None if left else broken[entries[0]])
        if error is not None:
            if len(self.files.files) == 1 and self.layers_found[error.where][1].kind == "?":
                raise Problem("not-usd", f"{error.message}.".replace("..", "."), code=error.code, layer=error.where)
            raise error
        return left

    def _find(self, layer: str, path: str) -> Found | None:
        container, file = self.layers_found[layer]
        return find(container, file.name, path)

    def _resolve_all(self) -> None:
        """Resolve every asset path of every layer: refuse those that lead outside the upload, note missing files."""
        for name, content in self.contents.items():
            for expression in content.expressions:
                refuse_expression(self.layers_found[name][0], self.layers_found[name][1].name, expression)
            for path in content.asset_paths:
                found = self._find(name, path)
                leads_to = _layer_of(found)
                self.named.add(leads_to)
                self.leads_to[name, path] = leads_to if leads_to in self.contents else None
                is_needed = path not in content.identifiers and path not in content.composition and "#" not in path
                if found is None and is_needed and not content.has_variables:
                    self.not_uploaded.append((name, path))
        self._resolve_documents()

    def _resolve_documents(self) -> None:
        """Resolve the paths in MaterialX documents likewise; composition reports unreadable ones."""
        for container, file in self.files.walk():
            name = container.shown(file.name)
            if not is_document(name):
                continue
            try:
                named = names_in(str(self.root / name))
            except AssetError:
                continue
            for path in (*named.documents, *named.files):
                if find(container, file.name, path) is None and "<" not in path:
                    self.not_uploaded.append((name, path))

    def _warn_of_unreadable(self) -> None:
        """Warn of unreadable layers that no layer refers to; composition reports the others."""
        for name, error in self.unreadable.items():
            if name not in self.named:
                self._warn("file-ignored", "", f"The layer {name!r} is omitted. {error.message}", "info")

    def _refuse_bombs(self, entry: str) -> None:
        found = expansion(self.contents, _root_layer(self.files, entry), lambda layer, path: self.leads_to.get((layer, path)))
        if found is None:
            return
        if found.composed > MOST_COMPOSED:
            raise too_large("prims", found.composed, MOST_COMPOSED)
        if found.expanded > self.limits.instances:
            raise too_large("prims of instances", found.expanded, self.limits.instances)

    def _compose(self, entry: str) -> SceneFacts:
        try:
            stage = scene_facts(self.root / entry)
        except DAMAGED:
            raise damaged(entry) from None
        if stage.used_layers > self.limits.layers:
            raise too_large("layers", stage.used_layers, self.limits.layers)
        if stage.missing and stage.drawable == 0:
            first = stage.missing[0]
            layer, path = self._shown(first)
            said = next(note.detail for note in stage.notes if note.code == "composition-error")
            raise Problem("asset-missing", f"{said} Nothing else is in the scene.", layer=layer, asset_path=path)
        for note in stage.notes:
            self._warn(note.code, note.prim, note.detail, note.severity, note.attribute)
        self._warn_of_not_uploaded({note.detail.partition(" ")[0] for note in stage.notes if note.code == "asset-missing"})
        return stage

    def _shown(self, missing: MissingLayer) -> tuple[str, str]:
        """Return layer and path as the uploader knows them: the same whether or not the file exists on this machine, without
        this machine's folders. A path that composition resolved outside the upload is reduced to its last component."""
        root = f"{self.root}/"
        path = missing.asset_path
        if path.startswith(root):  # for members of a usdz, USD reports absolute paths
            path = split_package(path.removeprefix(root))[1] or path.removeprefix(root)
        elif path.startswith("/"):
            path = f".../{path.rpartition('/')[2]}"
        return layer_file(missing.layer).removeprefix(root), path

    def _warn_of_not_uploaded(self, reported: Collection[str]) -> None:
        """Warn of files that were not uploaded and that the composed stage did not report: those of unselected variants, of
        clips, and of unbound materials."""
        for layer, path in self.not_uploaded:
            if path not in reported:
                self._warn("asset-not-uploaded", "", f"The layer {layer!r} names {path!r}, which was not uploaded.")

    def _package_facts(self, entries: list[str], entry: str | None) -> dict[str, Any]:
        files = [(container.shown(file.name), file) for container, file in self.files.walk()]
        return {
            "entry": entry,
            "entries": entries[:MOST_LISTED],
            "layers": layers_of(self.files.files)[:MOST_LISTED],
            "files": [{"name": name, "bytes": file.bytes, "kind": file.kind} for name, file in files[:MOST_LISTED]],
            "file_count": len(files),
        }

    def _warn_of_programs(self) -> None:
        for container, file in self.files.walk():
            if file.kind == "program":
                detail = f"The file {container.shown(file.name)!r} is a program or a plug-in's description; it is not loaded."
                self._warn("file-ignored", "", detail, "info")

    def _warn(self, code: str, prim: str, detail: str, severity: str = "warning", attribute: str = "") -> None:
        self.warnings.warn(code, prim, detail, severity, attribute)


class Warnings:
    """Warnings of a check: each once, up to a limit."""

    def __init__(self, channel: Sends) -> None:
        self._channel = channel
        self._warned: set[tuple[str, str, str, str]] = set()

    def warn(self, code: str, prim: str, detail: str, severity: str = "warning", attribute: str = "") -> None:
        key = (code, prim, detail, attribute)
        if key in self._warned or len(self._warned) > MOST_WARNINGS:
            return
        self._warned.add(key)
        if len(self._warned) > MOST_WARNINGS:
            code, prim, detail, severity = "more-warnings", "", f"There are more than {MOST_WARNINGS} warnings.", "info"
        kind = CODES[code].kind if code in CODES else Kind.NOTE  # the service's own codes are about files and names
        self._channel.send(
            "warning",
            code=code,
            prim=prim[:1024],
            detail=detail[:4000],
            severity=severity,
            kind=kind.value,
            attribute=attribute[:1024],
        )


def limits_of(asked: Mapping[str, Any]) -> Limits:
    known = {field.name for field in fields(Limits)}
    return Limits(**{name: value for name, value in asked.items() if name in known})


def damaged(layer: str) -> Problem:
    return Problem("layer-unreadable", "The layer is damaged: it has invalid names or prims.", layer=layer, line=None)


def too_large(what: str, count: int, limit: int, layer: str | None = None) -> Problem:
    extra: dict[str, Any] = {"count": count, "limit": limit} | ({"layer": layer} if layer is not None else {})
    return Problem("scene-too-large", f"The scene has {count:,} {what}; at most {limit:,} are allowed.", **extra)


def _root_layer(files: Container, name: str) -> str:
    """Return the layer that opening a file begins with: the first member of a usdz, recursively."""
    inner = files.inner.get(name)
    if inner is None or not inner.files:
        return files.shown(name)
    first = min(inner.files.values(), key=lambda file: file.at)
    return _root_layer(inner, first.name)


def _layer_of(found: Found | None) -> str | None:
    return None if found is None else _root_layer(found.container, found.file.name)


LAYERS = (".usd", ".usda", ".usdc")


def check_shared(command: Mapping[str, Any], channel: Sends) -> None:
    """Check a stage; Problem if it is refused; else sends `facts`, after its warnings."""
    channel.send("phase", phase="opening")
    root, stage = Path(command["root"]), Path(command["file"])
    limits = limits_of(command.get("limits") or {})
    _refuse_deep_text(stage, root, limits)
    found = dependencies(str(stage))
    layers = [file for file in found.files if file.lower().endswith(LAYERS)]
    if len(layers) > limits.layers:
        raise too_large("layers", len(layers), limits.layers)
    for file in found.files:
        _refuse_outside(file, root)
    for layer in layers:
        _refuse_paths_out(layer, root)
    channel.leave("facts", **_facts(stage, root, found.files, limits, Warnings(channel)))


def _facts(stage: Path, root: Path, files: tuple[str, ...], limits: Limits, warnings: Warnings) -> dict[str, Any]:
    try:
        composed = scene_facts(stage)
    except DAMAGED:
        raise damaged(_shown(str(stage), root)) from None
    if composed.used_layers > limits.layers:
        raise too_large("layers", composed.used_layers, limits.layers)
    if composed.missing and composed.drawable == 0:
        first = composed.missing[0]
        said = next(note.detail for note in composed.notes if note.code == "composition-error")
        layer, path = _shown(first.layer, root), _shown(first.asset_path, root)
        raise Problem("asset-missing", f"{said} Nothing else is in the scene.", layer=layer, asset_path=path)
    for note in composed.notes:
        warnings.warn(note.code, note.prim, note.detail, note.severity, note.attribute)
    listed = [{"name": _shown(file, root), "bytes": os.path.getsize(file)} for file in files[:MOST_LISTED]]
    package = {"entry": None, "entries": [], "layers": [], "files": listed, "file_count": len(files)}
    return {**package, **composed.facts}


def _refuse_deep_text(stage: Path, root: Path, limits: Limits) -> None:
    with stage.open("rb") as file:
        is_text = file.read(6).startswith(b"#usda ")
    if is_text:
        depth = nesting_depth(stage, limits.prim_depth, 0, stage.stat().st_size)
        if depth > limits.prim_depth:
            raise too_large("nested brackets", depth, limits.prim_depth, layer=_shown(str(stage), root))


def _refuse_paths_out(layer: str, root: Path) -> None:
    """Refuse paths that lead outside, by their text and by links."""
    try:
        content = layer_content(layer, _shown(layer, root))
    except (StageOpenError, *DAMAGED):
        return  # composition reports what is wrong with it
    for path in content.asset_paths:
        outer = split_package(path)[0].replace("\\", "/")
        place = posixpath.normpath(posixpath.join(posixpath.dirname(layer), outer))
        leads_out = bool(SCHEME.match(outer)) or not Path(place).is_relative_to(root)
        if leads_out or not Path(os.path.realpath(place)).is_relative_to(root):
            raise _outside(_shown(layer, root), path)


def _refuse_outside(file: str, root: Path) -> None:
    """Refuse a file that was opened through a search path, or through a link that only composition followed."""
    if not Path(os.path.realpath(file.partition("[")[0])).is_relative_to(root):
        raise _outside(_shown(file, root), posixpath.basename(file))


def _outside(layer: str, path: str) -> Problem:
    detail = f"The layer {layer!r} names {path!r}, which is outside the shared root."
    return Problem("asset-path-outside-job", detail, layer=layer, asset_path=path)


def _shown(path: str, root: Path) -> str:
    """Return a path as the client knows it: below the root; otherwise its last component."""
    if Path(path).is_relative_to(root):
        return Path(path).relative_to(root).as_posix()
    return path if not path.startswith("/") else f".../{posixpath.basename(path)}"
