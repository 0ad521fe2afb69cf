"""Files as whoever opened the stage knows them: by their paths from the root layer's folder, whatever the machine calls it.

USD resolves every path to an absolute one before it says anything of it. The same stage is to be told of in the same words in
a shell, in a report, and by a server that has it in a folder of its own.
"""

from __future__ import annotations

import os
import re

from pxr import Ar, Usd

from ..materialx.stand_ins import without_marks

IN_MEMORY = "a layer in memory"
_ANONYMOUS = re.compile(r"anon:0x[0-9a-fA-F]+(?::([^\s@<>'\"\]]+))?")
# What is said of a layer stack where nothing was chosen for the session, and of a reference's target: USD's own to know.
_OURS = re.compile(r",@anon:0x[0-9a-fA-F]+:[^@]*session\.usda@|:SDF_FORMAT_ARGS:[^@>\s]*")
_MOST_UP = 2  # folders above the root layer's that are told as ../; what lies further off keeps its whole path


class FileNames:
    """Of one stage, by its root layer's identifier or path ("": of none, where only layers in memory are named)."""

    def __init__(self, root: str) -> None:
        file = str(Ar.SplitPackageRelativePathOuter(root)[0]) if root and not root.startswith("anon:") else ""
        self._prefixes = _prefixes(file) if file else {}
        # A name ends what it stands for, and is no part of a longer path.
        known = "|".join(re.escape(prefix) for prefix in sorted(self._prefixes, key=len, reverse=True))
        self._known = re.compile(rf"(?<![\w/.\-])(?:{known})") if known else None

    def in_text(self, text: str) -> str:
        """The text with its files named so."""
        text = without_marks(text)
        if self._known is not None and "/" in text:
            text = self._known.sub(lambda found: self._prefixes[found[0]], text)
        text = _OURS.sub("", text)
        return _ANONYMOUS.sub(lambda found: found[1] or IN_MEMORY, text) if "anon:" in text else text


def file_names(stage: Usd.Stage) -> FileNames:
    return FileNames(str(stage.GetRootLayer().identifier))


def _prefixes(file: str) -> dict[str, str]:
    """What paths of the stage's files may begin with, and what is told instead."""
    found: dict[str, str] = {}
    for folder in {os.path.dirname(os.path.abspath(file)), os.path.dirname(os.path.realpath(file))}:
        up = ""
        for _ in range(_MOST_UP + 1):
            if folder == os.path.dirname(folder):
                break
            found.setdefault(f"{folder}/", up)
            folder, up = os.path.dirname(folder), f"../{up}"
    if os.path.dirname(file) and not os.path.isabs(file):  # as it was given: USD calls the root layer that
        found[f"{os.path.dirname(file)}/"] = ""
    return found
