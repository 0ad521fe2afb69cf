"""The files that a stage depends on, to copy them elsewhere. Opens all of them: for the user's own scenes only."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from ...diagnostics import Diagnostics
from ...errors import SettingsError, StageOpenError
from ...read_files import check_kept, note_read
from ..materials.materialx.documents import files_of_documents
from ..materials.materialx.filename_tokens import files_at, has_tokens
from ..stage.messages import FileNames, check_is_text, tf_message
from ..stage.open import open_layer, usd_messages

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")


@dataclass(frozen=True)
class Dependencies:
    """Files of a stage. `files`: absolute paths, the stage's own first. `missing`: asset paths that do not resolve.

    `fixed`: (layer, asset path) that resolve to the same file on this machine only: absolute paths, and those found by a search
    path.
    """

    files: tuple[str, ...]
    fixed: tuple[tuple[str, str], ...]
    missing: tuple[str, ...]


def dependencies(path: str) -> Dependencies:
    """Return the files of all variants, payloads, clips and tiles; raise StageOpenError if a layer cannot be read."""
    root = os.path.abspath(path)
    with usd_messages(Diagnostics(FileNames(root).in_text)):
        open_layer(root)  # its error is the most precise one
        layers, assets, missing = _all_of(root)
        for composed in _composed_layers(root):  # expression variables of one layer may change paths in another
            if composed not in layers:
                more_layers, more_assets, more_missing = _all_of(composed)
                layers, assets, missing = layers | more_layers, assets | more_assets, missing | more_missing
        named, not_there = files_of_documents(assets)
        assets, missing = assets | named, missing | not_there
        fixed = sorted({found for layer in layers for found in _fixed_paths(layer)})
    files = (root, *sorted((layers | assets) - {root}))
    for file in files:
        note_read(file)
    check_kept()
    return Dependencies(files, tuple(fixed), tuple(sorted(missing)))


def write_usdz(path: str, target: str) -> None:
    """Write a usdz of the stage and all its files, with their paths rewritten to refer to each other in it.

    There is no such function for a folder: USD rewrites paths to begin at the package's root, which a folder does not have.
    """
    with usd_messages(Diagnostics(FileNames(path).in_text)):
        try:
            UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(os.path.abspath(path)), target)
        except Tf.ErrorException as error:
            raise StageOpenError(f"USD cannot package it: {tf_message(error)}", where=path) from None
    if not os.path.isfile(target):  # USD returns False even where only a file is missing and the package is usable
        raise StageOpenError("USD cannot package it with the files it refers to.", where=path)


def _all_of(path: str) -> tuple[set[str], set[str], set[str]]:
    """Return the layers' files, other files, and asset paths that do not resolve."""
    try:
        layers, assets, missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(path))
    except Tf.ErrorException as error:
        raise StageOpenError(f"USD cannot open it: {tf_message(error)}", where=path) from None
    if not layers:
        raise StageOpenError("USD cannot open it.", where=path)
    files = {_file(layer.realPath) for layer in layers if layer.realPath}
    sets = {text: _files_of_set(text, files) for text in missing if has_tokens(text)}  # USD knows no placeholder but <UDIM>
    found = {_file(asset) for asset in assets}.union(*sets.values())
    known = {text for text in sets if sets[text] or _is_in_package(text, assets)}
    return files, found - files, set(missing) - known


def _files_of_set(text: str, layers: set[str]) -> set[str]:
    """Return the files that a name with placeholders stands for, next to the layers where it is relative."""
    folders = [""] if os.path.isabs(text) else sorted({os.path.dirname(layer) for layer in layers})
    return {file for folder in folders for file in files_at(os.path.join(folder, text))}


def _file(path: str) -> str:
    """Return the file on disk; for a member of a usdz, the usdz."""
    return os.path.abspath(str(Ar.SplitPackageRelativePathOuter(path)[0]))


def _is_in_package(text: str, assets: list[str]) -> bool:
    """Return whether the tiles that a name stands for are members of a usdz, where USD found them."""
    before, place, _ = text.partition("<UDIM>")
    return bool(place) and any(before in asset for asset in assets)


def _composed_layers(path: str) -> Iterator[str]:
    try:
        stage = Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        raise StageOpenError(f"USD cannot open it: {tf_message(error)}", where=path) from None
    yield from layer_files(stage)


def layer_files(stage: Usd.Stage) -> set[str]:
    """Return the absolute paths of the files of the layers that the stage is composed of."""
    return {_file(layer.realPath) for layer in stage.GetUsedLayers() if layer and layer.realPath}


def check_layer_output(stage: Usd.Stage, path: str | os.PathLike[str], but: str = "") -> None:
    """Raise SettingsError if the layer to write is one that the stage is composed of, whose content would be lost.

    `but`: root prim of layers that may be replaced, since they were written before by the same command.
    """
    target = os.path.realpath(path)
    for layer in stage.GetUsedLayers():
        if (
            layer
            and layer.realPath
            and os.path.realpath(_file(layer.realPath)) == target
            and (not but or not layer.GetPrimAtPath(f"/{but}"))
        ):
            sentence = "the output would overwrite a layer of the stage: give it another name"
            raise SettingsError(sentence, where=os.fspath(path), code="output-folder")


def _fixed_paths(file: str) -> Iterator[tuple[str, str]]:
    if file.endswith(".usdz"):
        return  # its own layers may refer only to what is in it
    try:
        layer = Sdf.Layer.OpenAsAnonymous(file)
    except Tf.ErrorException as error:
        raise StageOpenError(f"USD cannot open it: {tf_message(error)}", where=file) from None
    texts: list[str] = []

    def note(text: str) -> str:
        texts.append(text)
        return text

    UsdUtils.ModifyAssetPaths(layer, note)
    for text in texts:
        if os.path.isabs(text) or _SCHEME.match(text) or _is_found_by_searching(file, text):
            yield file, text


def _is_found_by_searching(file: str, text: str) -> bool:
    if text.startswith((".", "`")) or has_tokens(text):
        return False
    outer = Ar.SplitPackageRelativePathOuter(text)[0]
    beside = os.path.join(os.path.dirname(file), outer)
    return bool(outer) and not os.path.exists(beside) and bool(str(Ar.GetResolver().Resolve(outer)))


def files_to_watch(path: str) -> set[str]:
    """Return absolute paths of all files that a stage's picture may change with, missing ones included; only the root's where
    layers cannot be read."""
    root = os.path.abspath(path)
    check_is_text(root)
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        layers, assets, missing = _all_of(_file(root))
    except StageOpenError:
        return {_file(root)}
    finally:
        delegate.TakeUncoalescedDiagnostics()
    assets |= files_of_documents(assets)[0]
    return {_file(root)} | layers | assets | {_file(found) for found in missing if os.path.isabs(found)}
