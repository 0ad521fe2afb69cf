"""Resolution of asset paths by their text: to a file of the scene, to one that was not uploaded, or outside.

The sandbox enforces the boundary; this gives a clear message. Paths may go up as long as they stay in the upload.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator
from dataclasses import dataclass

from ..problems import Problem
from .package import Container, File

SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.\-]*:")
_LITERAL = re.compile(r"\"((?:[^\"\\]|\\.)*)\"|'((?:[^'\\]|\\.)*)'")
_VARIABLE = re.compile(r"\$\{[^}]*\}")


@dataclass(frozen=True)
class Found:
    container: Container
    file: File

    @property
    def name(self) -> str:
        return self.container.shown(self.file.name)


def find(container: Container, layer: str, asset_path: str) -> Found | None:
    """Return the file that an asset path of a layer refers to; None if it was not uploaded. Problem if it leads outside.

    Paths are relative to the layer; inside a usdz also to the package, as its specification says.
    """
    shown = container.shown(layer)
    outer, inner = split_package(asset_path)
    if leads_out(posixpath.dirname(layer), outer):
        raise Problem(
            "asset-path-outside-job",
            f"The layer {shown!r} names {asset_path!r}, which is outside the upload.",
            layer=shown,
            asset_path=asset_path,
        )
    places = [posixpath.dirname(layer)]
    if container.prefix and not outer.startswith(("./", "../")):
        places.append("")
    for place in places:
        for name in _names(container, posixpath.normpath(posixpath.join(place, outer))):
            return _inside(Found(container, container.files[name]), inner, shown, asset_path)
    _inside(None, inner, shown, asset_path)
    return None


def refuse_expression(container: Container, layer: str, expression: str) -> None:
    """Raise Problem if the literal parts of an expression lead outside for any values of its variables."""
    for literal in _LITERAL.finditer(expression):
        text = literal[1] if literal[1] is not None else literal[2]
        if leads_out(posixpath.dirname(layer), _VARIABLE.sub("x", text)):
            shown = container.shown(layer)
            raise Problem(
                "asset-path-outside-job",
                f"The layer {shown!r} names `{expression}`, which is outside the upload.",
                layer=shown,
                asset_path=f"`{expression}`",
            )


def leads_out(folder: str, path: str) -> bool:
    """Return whether a path leads outside: absolute, with a scheme or a drive, or further up than the folder's root."""
    plain = path.replace("\\", "/")
    if plain.startswith("/") or SCHEME.match(plain):
        return True
    return posixpath.normpath(posixpath.join(folder, plain)).split("/")[0] == ".."


def split_package(path: str) -> tuple[str, str | None]:
    """Return `a.usdz[b.usdz[c]]` as (`a.usdz`, `b.usdz[c]`)."""
    if path.endswith("]") and "[" in path:
        outer, _, inner = path[:-1].partition("[")
        return outer, inner
    return path, None


def _inside(outer: Found | None, inner: str | None, layer: str, asset_path: str) -> Found | None:
    """Return the member of a package; Problem if its name leads out of it, whether the package exists or not."""
    if inner is None:
        return outer
    name, further = split_package(inner)
    if leads_out("", name):
        raise Problem(
            "package-unsafe",
            f"The layer {layer!r} names {asset_path!r}, a member outside its package.",
            member=asset_path,
            layer=layer,
            asset_path=asset_path,
        )
    container = outer.container.inner.get(outer.file.name) if outer is not None else None
    file = container.files.get(posixpath.normpath(name)) if container is not None else None
    return _inside(Found(container, file) if container is not None and file is not None else None, further, layer, asset_path)


def _names(container: Container, path: str) -> Iterator[str]:
    """Yield the names of the file with this path, or of the first tile of a UDIM pattern."""
    if path in container.files:
        yield path
    elif "<UDIM>" in path:
        pattern = re.compile("".join(r"\d{4}" if part == "<UDIM>" else re.escape(part) for part in re.split("(<UDIM>)", path)))
        yield from (name for name in container.files if pattern.fullmatch(name))
