"""The picture of an asset that UsdMedia's AssetPreviewsAPI names, authored into the asset's own file.

Only the root layer's spec of the default prim is edited, by Sdf, without composing the stage. Files are written again as a
whole: values, paths and the order of specs stay, comments and white space of usda files do not. A usdz is packed again with
the entries that it has, in their order, and the picture as its last one.
"""

from __future__ import annotations

import os
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from pxr import Sdf, Tf

from ...errors import SceneError, StageOpenError
from .layer_copy import readable_layer
from .messages import tf_message
from .metadata import prim_value

CODE = "asset-preview"
SCHEMA = "AssetPreviewsAPI"
_PLACE = ("previews", "thumbnails", "default")  # dictionaries in assetInfo; the last one holds defaultImage
_LAYERS = (".usd", ".usda", ".usdc")
_CRATE = b"PXR-USDC"


def check_preview(asset: str) -> None:
    """Raise SceneError unless a picture can be named by the asset's default prim."""
    with _root_layer(asset) as layer:
        _default_prim(layer, asset)


def write_with_preview(asset: str, name: str, picture: str, target: str, scratch: str) -> None:
    """Write a copy of the asset to `target` whose default prim names the picture.

    `name` is the picture's path from the root layer's folder; a usdz gets the file `picture` under that name. `scratch` is an
    empty folder.
    """
    if _is_package(asset):
        _write_package(asset, name, picture, target, Path(scratch))
    else:
        _write_layer(asset, name, target, asset)


def _is_package(asset: str) -> bool:
    return asset.lower().endswith(".usdz")


@contextmanager
def _root_layer(asset: str) -> Iterator[Sdf.Layer]:
    file = asset
    if _is_package(asset):
        with _opened(asset) as package:
            file = f"{asset}[{_root_entry(package, asset).filename}]"
    yield readable_layer(file, where=asset)


def _default_prim(layer: Sdf.Layer, asset: str) -> Sdf.Path:
    path = layer.GetDefaultPrimAsPath()
    if not path.IsPrimPath() or not path.IsAbsolutePath():
        sentence = "a preview is of the default prim, but the root layer names none: author defaultPrim"
        raise SceneError(sentence, where=asset, code=CODE)
    return path


def _write_layer(file: str, name: str, target: str, asset: str) -> None:
    layer = readable_layer(file, where=asset)
    with Sdf.ChangeBlock():
        spec = Sdf.CreatePrimInLayer(layer, _default_prim(layer, asset))
        spec.SetInfo("apiSchemas", _with_schema(prim_value(spec, "apiSchemas")))
        spec.SetInfo("assetInfo", _with_picture(dict(prim_value(spec, "assetInfo")), _PLACE, name))
    arguments = {"format": _format_of(file)} if file.lower().endswith(".usd") else {}
    try:
        written = layer.Export(target, args=arguments)
    except Tf.ErrorException as error:
        raise SceneError(f"USD cannot write it: {tf_message(error)}", where=asset, code=CODE) from None
    if not written:
        raise SceneError("USD cannot write it.", where=asset, code=CODE)


def _format_of(file: str) -> str:
    """Return the format of a `.usd` file: either may have that name."""
    with open(file, "rb") as stream:
        return "usdc" if stream.read(len(_CRATE)) == _CRATE else "usda"


def _with_schema(schemas: Sdf.TokenListOp) -> Sdf.TokenListOp:
    """Return the list operation with the schema, in the form that it has."""
    if schemas.isExplicit:
        if SCHEMA not in schemas.explicitItems:
            schemas.explicitItems = [*schemas.explicitItems, SCHEMA]
    elif SCHEMA not in (*schemas.prependedItems, *schemas.appendedItems, *schemas.addedItems):
        schemas.prependedItems = [*schemas.prependedItems, SCHEMA]
    if SCHEMA in schemas.deletedItems:
        schemas.deletedItems = [item for item in schemas.deletedItems if item != SCHEMA]
    return schemas


def _with_picture(info: dict[str, Any], place: tuple[str, ...], name: str) -> dict[str, Any]:
    """Return a dictionary with the picture at a place below, and everything else that it has."""
    if not place:
        return info | {"defaultImage": Sdf.AssetPath(name)}
    inner = info.get(place[0])
    return info | {place[0]: _with_picture(dict(inner) if isinstance(inner, Mapping) else {}, place[1:], name)}


@contextmanager
def _opened(asset: str) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(asset) as package:
            yield package
    except (OSError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise StageOpenError(f"it is not a usdz that can be read: {error}", where=asset) from None


def _root_entry(package: zipfile.ZipFile, asset: str) -> zipfile.ZipInfo:
    entries = package.infolist()
    if not entries or not entries[0].filename.lower().endswith(_LAYERS):
        raise StageOpenError("it is not a usdz: its first entry is not a layer", where=asset)
    return entries[0]


def _write_package(asset: str, name: str, picture: str, target: str, scratch: Path) -> None:
    with _opened(asset) as package:
        root = _root_entry(package, asset)
        entries = [entry for entry in package.infolist() if not entry.is_dir()]
        files: dict[str, Path] = {}
        for k, entry in enumerate(entries):
            if entry.filename in files:
                raise SceneError(f"the package has two entries {entry.filename}", where=asset, code=CODE)
            # Names of entries may lead anywhere: files on disk are numbered.
            files[entry.filename] = scratch / f"{k}{PurePosixPath(entry.filename).suffix}"
            with package.open(entry) as stream, files[entry.filename].open("wb") as copy:
                shutil.copyfileobj(stream, copy)
    edited = scratch / f"root{PurePosixPath(root.filename).suffix}"
    _write_layer(str(files[root.filename]), name, str(edited), asset)
    files[root.filename] = edited
    files[os.path.normpath(str(PurePosixPath(root.filename).parent / name))] = Path(picture)
    _pack(files, target, asset)


def _pack(files: Mapping[str, Path], target: str, asset: str) -> None:
    try:
        writer = Sdf.ZipFileWriter.CreateNew(target)
        for name, file in files.items():
            if not writer.AddFile(str(file), name):
                raise SceneError(f"USD cannot pack {name}.", where=asset, code=CODE)
        if not writer.Save():
            raise SceneError("USD cannot pack it.", where=asset, code=CODE)
    except Tf.ErrorException as error:
        raise SceneError(f"USD cannot pack it: {tf_message(error)}", where=asset, code=CODE) from None
