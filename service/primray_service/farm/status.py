"""State of a Ray cluster: its nodes, the room on each for renders, and running chunks with their owners."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from primray.errors import PrimrayError

from ..executor.ray.link import Link, NotConnected
from ..jobs import Json
from ..limits import Limits

ANSWER_WITHIN_S = 60.0  # many drivers may have to be asked


@dataclass(frozen=True)
class FarmStatus:
    """Nodes, and owners with their chunks, in the form of protocol.py."""

    nodes: Sequence[Json]
    owners: Sequence[Json]

    def as_json(self) -> Json:
        return {"nodes": list(self.nodes), "owners": list(self.owners)}


def farm_status(settings: Mapping[str, Any]) -> FarmStatus:
    """Return the state of a cluster. `settings`: address, cores, labels and allow_unsandboxed, as for a server, whose slots are
    reported.

    Raises PrimrayError, with a code of protocol.py, if there is no usable cluster.
    """
    try:
        return asyncio.run(_asked({"slots": None, "limits": asdict(Limits()), **settings}))
    except NotConnected as error:
        raise PrimrayError(error.why, code=error.code) from None


async def _asked(settings: Json) -> FarmStatus:
    told: dict[str, Mapping[str, Any]] = {}
    answered = asyncio.Event()

    def on_line(line: Mapping[str, Any]) -> None:
        told[str(line["at"])] = line
        if line["at"] == "running":
            answered.set()

    link = await Link.connect(settings, on_line)
    try:
        link.send({"do": "look", "id": "1"})
        await asyncio.wait_for(answered.wait(), ANSWER_WITHIN_S)
    except TimeoutError:
        raise PrimrayError("the Ray cluster does not report its running chunks", code="ray-unreachable") from None
    finally:
        await link.close()
    return FarmStatus(told["cluster"]["nodes"], told["running"]["owners"])


def status_lines(status: FarmStatus, now: float) -> list[str]:
    """Return a table of nodes, each followed by its running chunks; `now` is Unix time, in seconds."""
    running: dict[str, list[tuple[str, Json]]] = {}
    for owner in status.owners:
        for chunk in owner["chunks"]:
            running.setdefault(chunk["node"], []).append((owner["owner"], chunk))
    rows = [("NODE", "HOST", "SLOTS", "RUNNING", "")]
    for node in status.nodes:
        here = running.pop(node["id"], [])
        rows.append((node["id"][:8], node["host"], str(node["slots"]), str(len(here)), node["why"]))
        rows += [_row(owner, chunk, now) for owner, chunk in here]
    for node_id, here in running.items():  # of nodes excluded by labels, or leaving
        rows.append((node_id[:8], "", "", str(len(here)), "not among the selected nodes"))
        rows += [_row(owner, chunk, now) for owner, chunk in here]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return [
        "  ".join([*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[4]]).rstrip() for row in rows
    ]


def _row(owner: str, chunk: Json, now: float) -> tuple[str, str, str, str, str]:
    seconds = max(now - float(chunk["since"]), 0.0)
    return "", "", "", "", f"{chunk['kind']} {chunk['name']}, {seconds:.0f} s, for {owner}"
