"""Reading of .mtlx bytes to a document of the MaterialX package, with its includes, and of the file names in documents.

The package's reader recurses into elements and follows includes without limit, so both are bounded before it parses anything.
Packaging and watching of scenes need the files that documents name: textures, tiles, and other documents.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import islice, product
from typing import Any

from pxr import Ar

from ....errors import AssetError, PrimrayError
from ...stage.reads import read_asset
from .filename_tokens import files_at, has_tokens
from .substitute_layers import is_document

MOST_BYTES = 64 << 20  # of a document with its includes
MOST_ELEMENTS = 200_000
MOST_INCLUDES = 256
MOST_NAMES = 10_000  # expansions of the tokens in one file name
# A lookahead is not backtracked into, which keeps matching linear in the text's length. Possessive repetition would do the
# same, but is broken in Python 3.11.2.
_MARKUP = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|(?P<doctype><!)|(?P<end></)[^>]*>"
    r"|<(?P<name>[^\s/>\"'<=]+)(?=(?P<body>(?:[^>\"'/]+|\"[^\"]*\"|'[^']*'|/(?!>))*))(?P=body)(?P<single>/)?>",
    re.DOTALL,
)
DEEPEST = 64  # nesting of elements, and of includes
# Defaults of a document's attributes, made explicit on included documents: Document::importLibrary passes on the included
# document's attributes, and its elements would inherit all others from its includer.
_DEFAULTS = {"colorspace": "none", "fileprefix": "", "geomprefix": ""}


def _bad(message: str, path: str) -> AssetError:
    return AssetError(message, where=path, code="materialx-document")


@cache
def library() -> Any:
    """Return the standard library's document, read once per process."""
    import MaterialX as mx

    made = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), made)
    return made


def read_document(path: str) -> Any:
    """Return the document at a resolved path; AssetError where it cannot be read."""
    import MaterialX as mx

    document = mx.createDocument()
    document.setDataLibrary(library())
    reader = _Reader(mx)
    try:
        reader.read(document, path, ())
    except PrimrayError:
        raise
    except Exception as error:  # the package raises its own and built-in exceptions of any class
        raise _bad(str(error) or type(error).__name__, path) from None
    return document


@dataclass(frozen=True)
class Named:
    """File names in a document, with their prefixes: documents that it includes, and files.

    `possible`: names formed from values of tokens, not all of which need to exist.
    """

    documents: tuple[str, ...]
    files: tuple[str, ...]
    possible: tuple[str, ...]


def names_in(path: str) -> Named:
    """Return the names in the document at a resolved path, without reading other files; AssetError if it cannot be read."""
    import MaterialX as mx

    document = mx.createDocument()
    included: list[str] = []
    options = mx.XmlReadOptions()
    options.readXIncludeFunction = lambda _document, name, _search, _options: included.append(name.asString())
    try:
        mx.readFromXmlString(document, checked_text(path, MOST_BYTES, MOST_ELEMENTS)[0], mx.FileSearchPath(), options)
        found = [element for element in document.traverseTree() if element.getAttribute("type") == "filename"]
        files = [name for element in found if (name := element.getResolvedValueString())]
        by_tokens = list(_names_by_tokens(document, found))
    except PrimrayError:
        raise
    except Exception as error:
        raise _bad(str(error) or type(error).__name__, path) from None
    return Named(tuple(dict.fromkeys(included)), tuple(dict.fromkeys(files)), tuple(dict.fromkeys(by_tokens)))


def _names_by_tokens(document: Any, files: list[Any]) -> Iterator[str]:
    """Yield the names that files with tokens may have, with each value that the document gives a token."""
    files = [element for element in files if "[" in element.getValueString()]
    values: dict[str, set[str]] = {}
    for token in (e for e in document.traverseTree() if files and e.getCategory() == "token"):
        values.setdefault(token.getName(), set()).add(token.getValueString())
    for element in files:
        names = [name for name in sorted(values) if f"[{name}]" in element.getValueString()]
        for chosen in islice(product(*(sorted(values[name]) for name in names)), MOST_NAMES):
            resolver = element.createStringResolver()
            for name, text in zip(names, chosen, strict=True):
                resolver.setFilenameSubstitution(f"[{name}]", text)
            yield str(element.getResolvedValueString(resolver))


class _Reader:
    """Reader of one document and its includes, with limits over all of them."""

    def __init__(self, mx: Any) -> None:
        self._mx = mx
        self._bytes = self._elements = self._includes = 0

    def read(self, document: Any, path: str, above: tuple[str, ...]) -> None:
        if path in above:
            raise _bad("it includes itself", path)
        if len(above) > DEEPEST or self._includes > MOST_INCLUDES:
            raise _bad(f"it includes more than {MOST_INCLUDES} documents, or nests them more than {DEEPEST} deep", path)
        text, size, elements = checked_text(path, MOST_BYTES - self._bytes, MOST_ELEMENTS - self._elements)
        self._bytes += size
        self._elements += elements
        options = self._mx.XmlReadOptions()
        options.readXIncludeFunction = self._include(path, (*above, path))
        self._mx.readFromXmlString(document, text, self._mx.FileSearchPath(), options)

    def _include(self, path: str, above: tuple[str, ...]) -> Callable[[Any, Any, Any, Any], None]:
        def read(document: Any, name: Any, _search: Any, _options: Any) -> None:
            self._includes += 1
            found = beside(name.asString(), path)
            self.read(document, found, above)
            for attribute, default in _DEFAULTS.items():
                if not document.hasAttribute(attribute):
                    document.setAttribute(attribute, default)
            _relocate_files(document, found, path)

        return read


def _relocate_files(document: Any, path: str, includer: str) -> None:
    """Make the file names of an included document relative to its includer, which receives its elements.

    A file that exists only beside the includer keeps its name: applications that search for files find it there.
    """
    folder, base = (os.path.dirname(_inner(p)) for p in (path, includer))
    if folder == base:
        return
    for element in document.traverseTree():
        name = element.getResolvedValueString() if element.getAttribute("type") == "filename" else ""
        if not name or os.path.isabs(name) or (_is_beside(name, includer) and not _is_beside(name, path)):
            continue
        moved = os.path.relpath(os.path.join(folder, name), base or ".").replace(os.sep, "/")
        element.setFilePrefix("")
        element.setValueString(moved)


def _inner(path: str) -> str:
    """Return a document's path within its package, or on disk."""
    return str(Ar.SplitPackageRelativePathInner(path)[1]) if Ar.IsPackageRelativePath(path) else path


def _is_beside(name: str, path: str) -> bool:
    try:
        return bool(Ar.GetResolver().Resolve(beside(name, path)))
    except AssetError:
        return False


def checked_text(path: str, most_bytes: int, most_elements: int) -> tuple[str, int, int]:
    """Return a document's text, byte count and element count, within limits of size and depth."""
    try:
        raw = read_asset(path, most_bytes)
    except PrimrayError as error:
        raise _bad(error.message, path) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _bad("it is not UTF-8 text", path) from None
    return text, len(raw), _elements(text, path, most_elements)


def _elements(text: str, path: str, most: int) -> int:
    """Return the number of elements; AssetError where they are too many, too deep, or malformed.

    The check is looser than XML, as the package's reader is: a value may contain "<".
    """
    count = depth = position = 0
    while (position := text.find("<", position)) >= 0:
        found = _MARKUP.match(text, position)
        if found is None:
            raise _bad(f"it is not XML: the markup at character {position} does not end", path)
        if found["doctype"]:
            raise _bad("it declares a document type, which MaterialX does not allow", path)
        if found["name"]:
            count += 1
            depth += 0 if found["single"] else 1
        elif found["end"]:
            depth -= 1
        if depth > DEEPEST or count > most:
            raise _bad(f"it has more than {MOST_ELEMENTS} elements, or nests them more than {DEEPEST} deep", path)
        position = found.end()
    return count


def beside(name: str, includer: str) -> str:
    """Return the path of a file named in a document: relative to the document, within the same package if it is in one."""
    if Ar.IsPackageRelativePath(includer):
        package, inner = Ar.SplitPackageRelativePathInner(includer)
        beside = os.path.normpath(os.path.join(os.path.dirname(inner), name)).replace(os.sep, "/")
        return str(Ar.JoinPackageRelativePath(package, beside))
    resolver = Ar.GetResolver()
    found = str(resolver.Resolve(resolver.CreateIdentifier(name, Ar.ResolvedPath(includer))))
    if not found:
        raise _bad(f"it names {name}, which cannot be found", includer)
    return found


def files_of_documents(paths: Iterable[str]) -> tuple[set[str], set[str]]:
    """Return the files named by the documents among these paths, and names of files that exist only here or not at all.

    Names of the second kind are missing or absolute. Documents that cannot be read are skipped.
    """
    found: set[str] = set()
    missing: set[str] = set()
    waiting = [path for path in paths if is_document(path)]
    seen = set(waiting)
    while waiting and len(seen) <= MOST_INCLUDES:
        document = waiting.pop()
        try:
            named = names_in(document)
        except AssetError:
            continue
        for name in (*named.documents, *named.files):
            files = _existing_files(name, document)
            found.update(files)
            if not files or os.path.isabs(name):
                missing.add(name)
        found.update(file for name in named.possible for file in _existing_files(name, document) if os.path.exists(file))
        for path in (file for name in named.documents for file in _existing_files(name, document)):
            if path not in seen:
                seen.add(path)
                waiting.append(path)
    return found, missing


def _existing_files(name: str, document: str) -> list[str]:
    """Return the paths of a name that exist on disk; all tiles of a set."""
    if has_tokens(name):
        return files_at(os.path.join(os.path.dirname(document), name))
    try:
        return [os.path.abspath(beside(name, document))]
    except AssetError:
        return []
