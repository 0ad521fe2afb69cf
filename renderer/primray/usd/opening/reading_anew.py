"""Reloading of layers whose files have changed, in place: stages composed of them are recomposed."""

from __future__ import annotations

import os
from collections.abc import Collection

from pxr import Ar, Sdf, Tf

from ...diagnostics import Diagnostics
from ...errors import AssetError, StageOpenError
from ..materialx.redirecting import make_anew
from ..querying.messages import tf_message
from .file_names import FileNames
from .stage import usd_messages


def read_anew(root: str, files: Collection[str]) -> None:
    """Reload the layers of the stage at `root` that come from these files (absolute paths).

    Raise StageOpenError at the first that cannot be read; it and those after it stay as they were.
    """
    names = FileNames(root)
    with usd_messages(Diagnostics(names.in_text)):
        for layer in Sdf.Layer.GetLoadedLayers():
            file = _file(layer)
            if file in files:
                _read(layer, names.in_text(file))
        try:
            make_anew(files)
        except AssetError as error:
            raise StageOpenError(error.message, where=names.in_text(error.where)) from None


def _file(layer: Sdf.Layer) -> str:
    """Return the layer's file on disk; for a member of a package, the package's."""
    path = str(layer.realPath)
    return os.path.abspath(str(Ar.SplitPackageRelativePathOuter(path)[0])) if path else ""


def _read(layer: Sdf.Layer, name: str) -> None:
    if not os.path.exists(_file(layer)):
        raise StageOpenError("There is no such file.", where=name)
    try:
        layer.Reload(force=True)
    except Tf.ErrorException as error:
        raise StageOpenError(f"USD cannot read it: {tf_message(error)}", where=name) from None
