"""Items that a chunk's task returns, in order: files in blocks, each before the message that names it."""

from __future__ import annotations

from dataclasses import dataclass

from ....jobs import Json


@dataclass(frozen=True)
class Refused:
    """Refusal by a node that takes no work: nothing was opened."""

    node: str
    why: str


@dataclass(frozen=True)
class Begun:
    node: str
    objects: int  # contents that were not cached there
    bytes: int


@dataclass(frozen=True)
class Part:
    name: str
    data: bytes


@dataclass(frozen=True)
class FileEnd:
    name: str
    sha256: str


@dataclass(frozen=True)
class Message:
    message: Json


@dataclass(frozen=True)
class End:
    """End of a chunk; `told`: base.Ended without what is on this node."""

    told: Json
    log: bytes


Item = Refused | Begun | Part | FileEnd | Message | End
