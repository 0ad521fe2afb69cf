"""A dispatcher with scripted workers, and what a test does to it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from tests.service.dispatcher.rig import Rig, dispatching
from tests.service.dispatcher.scripted import Script, ScriptedExecutor

QUICKLY_S = 30.0  # some 0.1 s on a machine that does nothing else
Act = Callable[[Rig, ScriptedExecutor], Awaitable[None]]


def play(root: Path, script: Script, act: Act, *, slots: int = 1, **limits: Any) -> ScriptedExecutor:
    """A dispatcher whose workers follow `script`, while `act` is done to it."""
    made: list[ScriptedExecutor] = []

    async def run() -> None:
        def make(data: Any, limits: Any) -> ScriptedExecutor:
            made.append(ScriptedExecutor(data, script, slots))
            return made[0]

        async with dispatching(root, make, **limits) as rig:
            await act(rig, made[0])

    asyncio.run(run())
    assert made[0].held == 0, "files of chunks are left"
    return made[0]
