"""What runs on the cluster, for whom: asked of every driver's mailbox."""

from __future__ import annotations

import asyncio

from ray.exceptions import RayError

from ....jobs import Json
from ..node.tasks import ask_running, owners

ANSWER_WITHIN_S = 5.0


async def what_runs(asking: str) -> list[Json]:
    """By owner, but for the one that asks; one that does not answer is left out: it is going."""
    found = []
    for owner in await asyncio.to_thread(owners):
        if owner == asking:
            continue
        try:
            asked = await asyncio.to_thread(ask_running, owner)
            chunks = await asyncio.wait_for(asyncio.wrap_future(asked.future()), ANSWER_WITHIN_S)
        except (RayError, ValueError, TimeoutError):
            continue
        found.append({"owner": owner, "chunks": chunks})
    return found
