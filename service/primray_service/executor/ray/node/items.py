"""What comes from a chunk's task, in order: files in parts, each before the message that names it."""

from __future__ import annotations

from dataclasses import dataclass

from ....jobs import Json


@dataclass(frozen=True)
class Refused:
    """By a node that takes no work: nothing was opened."""

    node: str
    why: str


@dataclass(frozen=True)
class Begun:
    node: str
    objects: int  # contents that it did not have
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
    """`told`: base.Ended without what lies on this node."""

    told: Json
    log: bytes


Item = Refused | Begun | Part | FileEnd | Message | End
