"""Layers in memory that stand in for files: their names, which tell the file, and where their relative paths lead.

A stand-in lies beside its file, so that its relative paths lead where the file's do. What is in a package cannot have one
there: it lies beside the package, and its paths are made whole.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Callable

from pxr import Ar, Sdf, UsdUtils

_MARK = re.compile(r"\.materialx-\d+\.usda")
_PLACE = re.compile(r"<UDIM>|<UVTILE>|frame\}")  # in names of files that are there under other names
_numbers = itertools.count(1)
_DOCUMENT = re.compile(r"\.mtlx$", re.IGNORECASE)


def is_document(path: str) -> bool:
    """Whether a resolved path is a MaterialX document's."""
    return bool(_DOCUMENT.search(path.rstrip("]")))


def without_marks(text: str) -> str:
    """A text that names stand-ins, with the names of what they stand for."""
    return _MARK.sub("", text) if ".materialx-" in text else text


def is_stand_in(layer: Sdf.Layer) -> bool:
    return bool(_MARK.search(str(layer.identifier)))


def new_layer(path: str) -> Sdf.Layer:
    """An empty one that stands in for the file of that path, which may be a package's member, or a layer in memory."""
    usda = Sdf.FileFormat.FindById("usda")
    outer = str(Ar.SplitPackageRelativePathOuter(path)[0])
    mark = f".materialx-{next(_numbers)}.usda"
    if outer.startswith("anon:"):
        return Sdf.Layer.CreateAnonymous(mark)
    inner = path.removeprefix(outer).strip("[]").replace("/", "_").replace("[", "_")
    return Sdf.Layer.New(usda, os.path.abspath(outer) + (f"-{inner}" if inner else "") + mark)


def anchor(layer: Sdf.Layer, path: str) -> None:
    """Make a stand-in's relative paths whole, where it does not lie beside what it stands for: a package's member."""
    if Ar.IsPackageRelativePath(path) or path.endswith(".usdz"):
        UsdUtils.ModifyAssetPaths(layer, _whole(path))


def _whole(path: str) -> Callable[[str], str]:
    package, inner = Ar.SplitPackageRelativePathInner(path) if Ar.IsPackageRelativePath(path) else (path, "")
    folder = os.path.dirname(inner)

    def whole(asset: str) -> str:
        if not asset or asset.startswith(("`", "/")) or Ar.IsPackageRelativePath(asset):
            return asset
        member = os.path.normpath(os.path.join(folder, asset)).replace(os.sep, "/")
        beside = str(Ar.JoinPackageRelativePath(package, member))
        if asset.startswith("./") or _PLACE.search(asset) or Ar.GetResolver().Resolve(beside):
            return beside
        at_root = str(Ar.JoinPackageRelativePath(package, os.path.normpath(asset)))  # what is not beside it is searched there
        return at_root if Ar.GetResolver().Resolve(at_root) else beside

    return whole
