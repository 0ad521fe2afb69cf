"""Data exchanged between the driver and a node: the order, its contents, and the items that come back.

A content is a file, or a folder as an archive, under its hash; in blocks, which are in Ray's object store. Items come in order:
files in blocks, each before the message that names it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ....jobs import Json


@dataclass(frozen=True)
class Wanted:
    """Properties that all nodes must share, so that a frame may continue on any of them with the same bits."""

    version: str
    isa: str
    build: Mapping[str, str]  # of the core for that ISA class
    needs_token: bool
    allow_unsandboxed: bool


@dataclass(frozen=True, kw_only=True)
class Order:
    key: str  # of its mailbox
    chunk: Json  # as in protocol.py; its paths are the server's
    inputs: Mapping[str, Content]
    folders: Mapping[str, Content]
    limits: Json
    cores: int
    wanted: Wanted


PART_BYTES = 32 * 2**20


@dataclass(frozen=True)
class Content:
    sha256: str  # of all blocks together, hexadecimal
    bytes: int
    is_folder: bool
    keep: bool  # whether it may be needed again
    parts: tuple[Any, ...]  # refs


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
    """End of a chunk; `about`: base.Ended without what is on this node."""

    about: Json
    log: bytes


Item = Refused | Begun | Part | FileEnd | Message | End
