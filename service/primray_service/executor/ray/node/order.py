"""Order to a node: a chunk, the location of its files, and the resources that it may use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ....jobs import Json
from .content import Content
from .fitness import Wanted


@dataclass(frozen=True)
class Order:
    key: str  # of its mailbox
    chunk: Json  # as in protocol.py; its paths are the server's
    inputs: Mapping[str, Content]
    folders: Mapping[str, Content]
    limits: Json
    cores: int
    wanted: Wanted
