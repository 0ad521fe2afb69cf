"""Workers of a test that take samples of a frame in parts: a checkpoint says which samples it holds, and nothing else."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from tests.service.dispatcher.scripted import Script, Worker

Range = tuple[int, int]
Hook = Callable[[Worker, str], Awaitable[None]]  # may raise Dies; the second says where the worker is


async def no_hook(worker: Worker, where: str) -> None:
    return


@dataclass
class Pieces:
    """`error_at`: of so many samples; `taken`: the range of each part that came to its end; `shown`: what pictures were of."""

    hook: Hook = no_hook
    error_at: Callable[[int], float] = lambda samples: 1.0 / samples
    taken: list[Range] = field(default_factory=list)
    shown: list[Range] = field(default_factory=list)
    pause_s: float = 0.0

    @property
    def script(self) -> Script:
        return self._play

    async def _play(self, worker: Worker) -> None:
        if worker.command["do"] == "merge":
            await self._merge(worker)
        elif worker.command.get("part"):
            await self._part(worker)
        else:
            await self._picture(worker)

    async def _part(self, worker: Worker) -> None:
        first, end = worker.command["settings"]["sample_range"]
        worker.sampling()
        await self.hook(worker, "sampling")
        worker.progress(0.5)
        await asyncio.sleep(self.pause_s)
        if "yield" in worker.told:
            worker.checkpoint(b"half")
            worker.say("yielded", number=worker.number)
            return
        worker.checkpoint(json.dumps([[first, end]]).encode())
        await self.hook(worker, "saved")
        self.taken.append((first, end))
        stop = {"reason": "samples", "target_met": None}
        worker.say("done", outputs=[], report={"stop": stop, "samples": end - first, "rays": 10})

    async def _merge(self, worker: Worker) -> None:
        held = [json.loads(worker.chunk.inputs[name].read_bytes()) for name in worker.command["parts"]]
        ranges = sorted(tuple(span) for spans in held for span in spans)
        assert all(a[1] == b[0] for a, b in itertools.pairwise(ranges)), ranges
        end = ranges[-1][1]
        await self.hook(worker, "merging")
        worker.checkpoint(json.dumps([[ranges[0][0], end]]).encode())
        await self.hook(worker, "merged")
        estimate = self.error_at(end)
        error = {"metric": "relmse", "estimate": estimate, "ci95": [estimate, estimate], "kind": "estimated"}
        error["target"] = target = worker.command["target"]
        met = target is not None and estimate <= target
        found = {"ranges": [[ranges[0][0], end]], "rays": 10, "error": error, "target_met": met}
        worker.say("done", outputs=[], report={"samples": end, "parts": found})

    async def _picture(self, worker: Worker) -> None:
        [(first, end)] = json.loads(worker.went_on_from)
        worker.sampling()
        await self.hook(worker, "picture")
        if not worker.command["picture_only"]:
            worker.checkpoint(worker.went_on_from)
        self.shown.append((first, end))
        settings = worker.command["settings"]
        met = None if settings["target_error"] is None else self.error_at(end) <= settings["target_error"]
        reason = "interrupted" if worker.command["picture_only"] else "target-error" if met else "samples"
        worker.done(reason, met=met)
