"""Workers of a test that take samples of a frame in parts: a checkpoint says which samples it holds, and when their
error was measured."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field

from tests.service.dispatcher.parts.one_render import Seen, judge
from tests.service.dispatcher.scripted import Script, Worker

Range = tuple[int, int]
Hook = Callable[[Worker, str], Awaitable[None]]  # may raise Dies; the second says where the worker is


def holding(samples: Range, seen: Sequence[Seen] = ()) -> bytes:
    return json.dumps({"samples": samples, "seen": seen}).encode()


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
        worker.checkpoint(holding((first, end)))
        await self.hook(worker, "saved")
        self.taken.append((first, end))
        stop = {"reason": "samples", "target_met": None}
        worker.say("done", outputs=[], report={"stop": stop, "samples": end - first, "rays": 10})

    async def _merge(self, worker: Worker) -> None:
        held = [json.loads(worker.chunk.inputs[name].read_bytes()) for name in worker.command["parts"]]
        ranges = sorted(tuple(each["samples"]) for each in held)
        assert all(a[1] == b[0] for a, b in itertools.pairwise(ranges)), ranges
        end = ranges[-1][1]
        await self.hook(worker, "merging")
        target = worker.command["target"]
        judged = None
        if target is not None:
            judged = judge(end, [tuple(row) for row in held[0]["seen"]], self.error_at, target, worker.command["most"])
        worker.checkpoint(holding((ranges[0][0], end), () if judged is None else judged.seen))
        await self.hook(worker, "merged")
        estimate = self.error_at(end)
        error = {"metric": "relmse", "estimate": estimate, "ci95": [estimate, estimate], "kind": "estimated", "target": target}
        found = {"ranges": [[ranges[0][0], end]], "rays": 10, "error": error, "judged": None}
        if judged is not None:
            met = judged.over == "target-error"
            found["judged"] = {"target_met": met, "goal": judged.goal, "expected": judged.expected}
        worker.say("done", outputs=[], report={"samples": end, "parts": found})

    async def _picture(self, worker: Worker) -> None:
        first, end = json.loads(worker.went_on_from)["samples"]
        worker.sampling()
        await self.hook(worker, "picture")
        if not worker.command["picture_only"]:
            worker.checkpoint(worker.went_on_from)
        self.shown.append((first, end))
        settings = worker.command["settings"]
        met = None if settings["target_error"] is None else self.error_at(end) <= settings["target_error"]
        reason = "interrupted" if worker.command["picture_only"] else "target-error" if met else "samples"
        worker.done(reason, met=met)
