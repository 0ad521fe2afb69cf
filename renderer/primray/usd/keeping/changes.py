"""What has changed on a stage, as USD's notices tell it: heard from the first moment on, taken by whoever translates next."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf, Tf, Usd

VALUES = frozenset({"default", "timeSamples"})  # the fields of an attribute that are its value


@dataclass
class Changes:
    """Attributes whose values alone have changed, by path; `others`: what else has, so that anything may be otherwise."""

    values: dict[Sdf.Path, None] = field(default_factory=dict)  # in order
    others: bool = False

    def add(self, later: Changes) -> None:
        self.values |= later.values
        self.others |= later.others

    def __bool__(self) -> bool:
        return self.others or bool(self.values)


class StageChanges:
    """Those of one stage since they were last taken. It hears of them in whichever thread edits the stage, while it lives."""

    def __init__(self, stage: Usd.Stage) -> None:
        self._heard = heard = _Heard()
        self._listening = Tf.Notice.Register(Usd.Notice.ObjectsChanged, lambda notice, _: heard.hear(notice), stage)

    def take(self) -> Changes:
        """All so far, which are forgotten here."""
        return self._heard.take()


class _Heard:
    """Apart from who listens, whom notices would else keep."""

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
