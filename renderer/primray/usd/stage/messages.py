"""Texts of USD's errors, and names of files in messages.

USD's texts may hold bytes that are not UTF-8 (they quote files), so they are decoded here. USD resolves every path to an
absolute one before it reports on it; messages name files relative to the folder of the root layer, so that a stage is described
in the same words in a shell, in a report, and by a server that keeps it in a folder of its own.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pxr import Ar, Tf, Usd

from ...errors import InvalidSceneError, StageOpenError
from ..materials.materialx.substitute_layers import with_original_names

_BREAK = re.compile(r"\s*\n\s*([;,.]?)")  # USD quotes errors that end their line in the middle of a sentence
_PARSER = re.compile(r"parse error matching \S*pegtl::\S*")  # names of the parser's own types


def error_text(message: Any, field: str = "") -> str:
    """Return the text of one of USD's messages, or of its `field`, on one line, with bytes that are not UTF-8 replaced."""
    try:
        text = str(getattr(message, field) if field else message)
    except UnicodeDecodeError as error:
        text = error.object.decode("utf-8", "replace")
    return _PARSER.sub("unexpected text", _BREAK.sub(lambda found: found[1] or " ", text.strip()))


def tf_message(error: Tf.ErrorException) -> str:
    """Return what went wrong, without USD's source locations, and without sentences that another one repeats."""
    texts = [error_text(part, "commentary" if hasattr(type(part), "commentary") else "") for part in error.args]
    told = [text for text in dict.fromkeys(texts) if not any(text in other for other in texts if other != text)]
    return "; ".join(told) or "unknown USD error"


@contextmanager
def scene_errors() -> Iterator[None]:
    """Raise InvalidSceneError where USD fails in a call that is not guarded, such as for a prim whose name is not text."""
    try:
        yield
    except Tf.ErrorException as error:
        raise InvalidSceneError(f"USD cannot read the stage: {tf_message(error)}", code="damaged-stage") from error
    except UnicodeDecodeError as error:
        raise InvalidSceneError(f"The stage holds a name that is not UTF-8: {error.object!r}", code="damaged-stage") from error


def check_is_text(path: str, *, where: str = "") -> None:
    """Raise StageOpenError, at `where` or the path, for a path that is not UTF-8, which USD's readers fail on."""
    try:
        path.encode()
    except UnicodeError:
        raise StageOpenError("The path is not valid UTF-8, which USD needs.", where=where or path) from None


IN_MEMORY = "a layer in memory"
_ANONYMOUS = re.compile(r"anon:0x[0-9a-fA-F]+(?::([^\s@<>'\"\]]+))?")
# How USD identifies an empty session layer in a layer stack, and a reference's format arguments: of no use to a reader.
_OURS = re.compile(r",@anon:0x[0-9a-fA-F]+:[^@]*session\.usda@|:SDF_FORMAT_ARGS:[^@>\s]*")
_MOST_UP = 2  # levels above the root layer's folder that are written as ../; files further up keep their whole path


class FileNames:
    """Shortener of file paths in texts about one stage, given its root layer's identifier or path ("" if it only has layers in
    memory)."""

    def __init__(self, root: str) -> None:
        file = str(Ar.SplitPackageRelativePathOuter(root)[0]) if root and not root.startswith("anon:") else ""
        self._prefixes = _prefixes(file) if file else {}
        # A prefix counts at the beginning of a path only, not in the middle of a longer one.
        known = "|".join(re.escape(prefix) for prefix in sorted(self._prefixes, key=len, reverse=True))
        self._known = re.compile(rf"(?<![\w/.\-])(?:{known})") if known else None

    def in_text(self, text: str) -> str:
        """Return the text with absolute paths of the stage's files replaced by relative ones, and anonymous layers by their
        names."""
        text = with_original_names(text)
        if self._known is not None and "/" in text:
            text = self._known.sub(lambda found: self._prefixes[found[0]], text)
        text = _OURS.sub("", text)
        return _ANONYMOUS.sub(lambda found: found[1] or IN_MEMORY, text) if "anon:" in text else text


def file_names(stage: Usd.Stage) -> FileNames:
    return FileNames(str(stage.GetRootLayer().identifier))


def _prefixes(file: str) -> dict[str, str]:
    """Return the prefixes that paths of the stage's files may have, with what replaces each in a message."""
    found: dict[str, str] = {}
    for folder in {os.path.dirname(os.path.abspath(file)), os.path.dirname(os.path.realpath(file))}:
        up = ""
        for _ in range(_MOST_UP + 1):
            if folder == os.path.dirname(folder):
                break
            found.setdefault(f"{folder}/", up)
            folder, up = os.path.dirname(folder), f"../{up}"
    if os.path.dirname(file) and not os.path.isabs(file):  # USD uses it as given as the root layer's identifier
        found[f"{os.path.dirname(file)}/"] = ""
    return found
