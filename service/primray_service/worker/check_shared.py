"""The check of a stage on shared storage: its references stay in its shared root, and it can be composed.

The sandbox enforces the boundary: a worker sees only the root of the file system's folders. The check gives messages that name
the layer at fault.
"""

from __future__ import annotations

import os
import posixpath
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from primray.errors import StageOpenError
from primray.usd import dependencies
from primray.usd.inspect.layer_content import layer_content, nesting_depth
from primray.usd.inspect.scene_facts import scene_facts

from ..limits import Limits
from ..problems import Problem
from .asset_paths import SCHEME, split_package
from .check import DAMAGED, MOST_LISTED, Sends, Warnings, damaged, limits_of, too_large

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
