"""Changes of a stage, collected from USD's notices until the next translation takes them."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf, Tf, Usd

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
        told = _told(notice)
        with self._lock:
            self._changes.add(told)


def _told(notice: Any) -> Changes:
    if notice.GetResyncedPaths() or notice.GetResolvedAssetPathsResyncedPaths():
        return Changes(others=True)
    values: dict[Sdf.Path, None] = {}
    for path in notice.GetChangedInfoOnlyPaths():
        fields = notice.GetChangedFields(path)
        if not path.IsPrimPropertyPath() or not fields or not VALUES.issuperset(fields):
            return Changes(others=True)
        values[path] = None
    return Changes(values)
