"""Running chunks of the cluster and their owners, as every driver's mailbox reports them."""

from __future__ import annotations

import asyncio

from ray.exceptions import RayError

from ....jobs import Json
from ..node.tasks import ask_running, owners

ANSWER_WITHIN_S = 5.0


async def what_runs(asking: str) -> list[Json]:
    """Return the running chunks by owner, except those of the asking driver; an owner that does not answer is ending and is
    left out."""
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
