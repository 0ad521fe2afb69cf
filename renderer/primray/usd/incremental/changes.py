"""Edits of a stage, collected from USD's notices until the next translation takes them, and what they affect."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf, Tf, Usd

from ..scene.translated_scene import Record
from ..stage.reads import type_name

VALUES = frozenset({"default", "timeSamples"})  # the fields of an attribute that are its value


@dataclass
class Changes:
    """Paths of attributes of which only values have changed; `others`: anything else has, so that everything may differ."""

    values: dict[Sdf.Path, None] = field(default_factory=dict)  # in order
    others: bool = False

    def add(self, later: Changes) -> None:
        self.values |= later.values
        self.others |= later.others

    def __bool__(self) -> bool:
        return self.others or bool(self.values)


class StageChanges:
    """Changes of one stage since they were last taken. Notices arrive in whichever thread edits the stage."""

    def __init__(self, stage: Usd.Stage) -> None:
        self._heard = heard = _Heard()
        self._listening = Tf.Notice.Register(Usd.Notice.ObjectsChanged, lambda notice, _: heard.hear(notice), stage)

    def take(self) -> Changes:
        """Return all changes so far, and begin with none."""
        return self._heard.take()


class _Heard:
    """Collected changes, separate from StageChanges, which the registered listener would otherwise keep alive."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._changes = Changes()

    def take(self) -> Changes:
        with self._lock:
            taken, self._changes = self._changes, Changes()
        return taken

    def hear(self, notice: Any) -> None:
        told = _changes_in(notice)
        with self._lock:
            self._changes.add(told)


def _changes_in(notice: Any) -> Changes:
    if notice.GetResyncedPaths() or notice.GetResolvedAssetPathsResyncedPaths():
        return Changes(others=True)
    values: dict[Sdf.Path, None] = {}
    for path in notice.GetChangedInfoOnlyPaths():
        fields = notice.GetChangedFields(path)
        if not path.IsPrimPropertyPath() or not fields or not VALUES.issuperset(fields):
            return Changes(others=True)
        values[path] = None
    return Changes(values)


# Types that are read again for every picture, and affect nothing else.
_LOOKED_UP = frozenset({"Camera", "RenderSettings", "RenderProduct", "RenderVar"})
_SHADING = frozenset({"Shader", "NodeGraph", "Material"})
# Attributes that are inherited, or that decide which prims are drawn.
_INHERITED = ("primvars:", "motion:", "material:", "collection:", "model:", "xformOp", "colorSpace", "skel:")
_DECIDING = frozenset({"visibility", "purpose", "guideVisibility", "proxyVisibility", "renderVisibility", "proxyPrim"})


@dataclass
class Affected:
    """Paths of prims whose transforms have changed, of leaves with other values, and of shading prims with other values."""

    moved: set[str] = field(default_factory=set)
    leaves: set[str] = field(default_factory=set)
    shading: set[Sdf.Path] = field(default_factory=set)


def affected_by(paths: Iterable[Sdf.Path], stage: Usd.Stage, record: Record) -> Affected:
    """Return what these attributes affect; raise NotKnownError where one of them may affect anything."""
    found = Affected()
    for path in paths:
        prim, name = stage.GetPrimAtPath(path.GetPrimPath()), path.name
        kind, at = type_name(prim) if prim else "", str(path.GetPrimPath())
        if name.startswith("xformOp:"):
            found.moved.add(at)
        elif kind in _SHADING and name.startswith("inputs:"):
            found.shading.add(path.GetPrimPath())
        elif name in _DECIDING or name.startswith(_INHERITED) or kind in _SHADING:
            raise UnknownEffect
        elif at in record.leaves:
            found.leaves.add(at)
        elif kind not in _LOOKED_UP:
            raise UnknownEffect
    return found


class UnknownEffect(Exception):
    """Raised where the effect of an edit is not known, so that everything is translated again; never shown to users."""
