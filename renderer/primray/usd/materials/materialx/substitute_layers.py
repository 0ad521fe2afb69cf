"""Substitute layers: in-memory layers in place of files, their identifiers, and the resolution of their relative paths.

A substitute has an identifier beside its file, so that relative paths resolve as the file's do. For a file inside a package
that is not possible: its substitute is beside the package, and its relative paths are made absolute.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Callable

from pxr import Ar, Sdf, UsdUtils

_MARK = re.compile(r"\.materialx-\d+\.usda")
_PLACE = re.compile(r"<UDIM>|<UVTILE>|frame\}")  # placeholders in file names
_numbers = itertools.count(1)
_DOCUMENT = re.compile(r"\.mtlx$", re.IGNORECASE)


def is_document(path: str) -> bool:
    """Return whether a resolved path is a MaterialX document's."""
    return bool(_DOCUMENT.search(path.rstrip("]")))


def with_original_names(text: str) -> str:
    """Return a text with identifiers of substitute layers replaced by the names of their files."""
    return _MARK.sub("", text) if ".materialx-" in text else text


def is_substitute(layer: Sdf.Layer) -> bool:
    return bool(_MARK.search(str(layer.identifier)))


def new_layer(path: str) -> Sdf.Layer:
    """Return an empty substitute layer for a path, which may be in a package, or that of an in-memory layer."""
    usda = Sdf.FileFormat.FindById("usda")
    outer = str(Ar.SplitPackageRelativePathOuter(path)[0])
    mark = f".materialx-{next(_numbers)}.usda"
    if outer.startswith("anon:"):
        return Sdf.Layer.CreateAnonymous(mark)
    inner = path.removeprefix(outer).strip("[]").replace("/", "_").replace("[", "_")
    return Sdf.Layer.New(usda, os.path.abspath(outer) + (f"-{inner}" if inner else "") + mark)


def anchor(layer: Sdf.Layer, path: str) -> None:
    """Make the relative paths of a substitute absolute if its file is in a package."""
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
        at_root = str(Ar.JoinPackageRelativePath(package, os.path.normpath(asset)))  # fallback of Ar's search within packages
        return at_root if Ar.GetResolver().Resolve(at_root) else beside

    return whole
