"""One hold of the lease, from acquiring it until it is lost or released: what runs, what waits, who is notified.

Everything that runs here ends before the hold does: the next holder, maybe this same process, starts with nothing in progress.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from contextlib import suppress
from typing import Any

from primray.distributed.planner import FEWEST

from ..executor.base import end_tasks
from ..queue.order import frames_to_preempt
from ..store.base import Claim, Lost
from .checks import check_scene
from .context import Context
from .frames.job_progress import SharedJobs
from .frames.running import RunningFrame
from .lease import Lease
from .parts.parallel_frame import ParallelFrame
from .parts.plan import rules_of
from .retention import Retention

LOG = logging.getLogger(__name__)

LOOK_EVERY_S = 0.5
LOOK_SOONEST_S = 0.05  # after the last look at jobs
PREEMPT_SOONEST_S = 0.25  # after the last look at who waits: short frames leave their slots anyway
LOOK_AT_DISK_EVERY_S = 2.0
STOP_WITHIN_S = 4.0
PREVIEW_ASKED_S = 15.0  # a client that asked for a preview this long before the frame began is still watching
MOST_ASKED = 1000
MOST_CLAIMS = 100  # per transaction: more take longer for each claim, and delay others


class Scheduler:
    def __init__(self, context: Context, lease: Lease) -> None:
        self._context = context
        self._lease = lease
        self._jobs = SharedJobs(context)
        self._running: dict[tuple[str, int], ClaimedFrame] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._awake = asyncio.Event()
        self._starting = asyncio.Lock()  # serialises claims, or more frames than slots would be claimed
        self._stopping = False
        self._is_lost = False
        self.has_failed = False  # by an internal error
        self._check: asyncio.Task[None] | None = None
        self._turn = 0  # number of frames claimed
        self._served: dict[str, int] = {}  # turn of each tenant's last claim
        self._asked: dict[tuple[str, int], float] = {}  # previews requested for frames that did not run yet
        self._disk_at = 0.0
        self._look_at = 0.0
        self._preempt_at = 0.0
        self._later: asyncio.TimerHandle | None = None

    def wake(self) -> None:
        self._awake.set()

    def ask_preview(self, job_id: str, frame: int) -> None:
        running = self._running.get((job_id, frame))
        if running is not None:
            running.ask_preview()
            return
        now = time.monotonic()
        self._asked = {key: at for key, at in self._asked.items() if now - at < PREVIEW_ASKED_S}
        if len(self._asked) < MOST_ASKED:
            self._asked[job_id, frame] = now

    def stop(self) -> None:
        self._stopping = True
        self._awake.set()

    async def live(self) -> None:
        """Run until the lease is lost, or until `stop` and all that ran has been stored."""
        keeping = asyncio.create_task(self._lease.keep())
        keeping.add_done_callback(lambda _: self._awake.set())
        self._spawn(Retention(self._context, self._expired).keep_on(), "retention")
        try:
            while not keeping.done() and not self._stopping and not self.has_failed and not self._is_lost:
                await self._round()
                await self._pause()
            if self._stopping and not keeping.done():
                await self._shut_down()
        except Lost:
            pass
        finally:
            await self._end_all()
            await end_tasks([keeping])

    async def _pause(self) -> None:
        with suppress(TimeoutError):
            await asyncio.wait_for(self._awake.wait(), LOOK_EVERY_S)
        self._awake.clear()

    async def _round(self) -> None:
        await self._fill_slots()
        now = time.monotonic()
        if now < self._look_at:  # a frame of many has ended: the shared work is not repeated each time
            self._look_later(self._look_at - now)
            return
        self._look_at = now + LOOK_SOONEST_S
        await self._start_check()
        await self._look_at_jobs()
        await self._ask_to_give_way()

    def _look_later(self, seconds: float) -> None:
        if self._later is None or self._later.when() <= asyncio.get_running_loop().time():
            self._later = asyncio.get_running_loop().call_later(seconds, self._awake.set)

    async def _shut_down(self) -> None:
        """Let running frames write a checkpoint and queue again, for this server's next start or another server."""
        for running in list(self._running.values()):
            running.shut_down()
        frames = {task for task in self._tasks if task.get_name() == "frame"}
        if frames:
            await asyncio.wait(frames, timeout=STOP_WITHIN_S)
        for running in list(self._running.values()):
            running.kill("shutdown")
        frames = {task for task in frames if not task.done()}
        if frames:
            await asyncio.wait(frames, timeout=1.0)

    async def _end_all(self) -> None:
        """Kill all chunks and write nothing more; the next holder of the lease finds the frames running, and takes them."""
        for running in list(self._running.values()):
            running.kill("lost")
        while self._tasks:
            await end_tasks(self._tasks)
            await asyncio.sleep(0)  # until each has been taken from the set

    def _spawn(self, work: Coroutine[Any, Any, None], name: str) -> asyncio.Task[None]:
        task = asyncio.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        self._context.metrics.running = len(self._running)
        error = None if task.cancelled() else task.exception()
        if isinstance(error, Lost):
            self._is_lost = True
        elif error is not None:
            # Rows may be outdated now; acquiring the lease again repairs them.
            LOG.error("the dispatcher's %s failed, so the dispatcher restarts", task.get_name(), exc_info=error)
            self.has_failed = True
        self._awake.set()

    def _free_slots(self) -> int:
        taken = sum(running.slots for running in self._running.values())
        return self._context.executor.capacity().slots - taken

    async def _start_frames(self) -> bool:
        """Start frames in free slots; False if no frame waits."""
        context = self._context
        # The needs of frames in parts are decided again after each frame that begins.
        most = 1 if any(running.wants_slot for running in self._parallel()) else min(self._free_slots(), MOST_CLAIMS)
        running = Counter(running.job.tenant for running in self._running.values() if running.slots > 0)
        asked = (context.fence, time.time(), context.quotas_of, most, self._served, running)
        claims = await context.calls.store(context.store.claim_frames, *asked)
        for claim in claims:
            self._start_frame(claim)
        return bool(claims)

    def _start_frame(self, claim: Claim) -> None:
        self._turn += 1
        self._served[claim.job.tenant] = self._turn
        for other in self._parallel():
            other.was_preempted = False
        metrics = self._context.metrics
        metrics.frames_started += 1
        metrics.queue_wait.observe(max(time.time() - claim.job.queued_at, 0.0))
        running = select_mode(self._context, self._jobs, claim, self._fill_slots)
        self._running[running.key] = running
        if time.monotonic() - self._asked.pop(running.key, -PREVIEW_ASKED_S) < PREVIEW_ASKED_S:
            running.ask_preview()
        metrics.running = len(self._running)
        self._spawn(self._live_frame(running), "frame")

    async def _live_frame(self, running: ClaimedFrame) -> None:
        try:
            await running.live()
        finally:
            if self._running.get(running.key) is running:
                del self._running[running.key]

    async def _fill_slots(self) -> None:
        """Fill the slots that frames have left; passes that run concurrently do the same."""
        if not self._stopping:
            async with self._starting:
                while self._free_slots() > 0 and await self._has_disk():
                    if not await self._fill_slot():
                        return

    def _parallel(self) -> list[ParallelFrame]:
        return [running for running in self._running.values() if isinstance(running, ParallelFrame)]

    async def _fill_slot(self) -> bool:
        """Fill one slot; False if nothing waits for one."""
        return await self._start_part(is_first=True) or await self._start_frames() or await self._start_part(is_first=False)

    async def _start_part(self, *, is_first: bool) -> bool:
        """Give a slot to a frame that is rendered as parts; `is_first`: only to one that precedes all waiting frames, by its
        priority, or because it has begun and has no slot, unless it was just preempted."""
        wanting = [running for running in self._parallel() if running.wants_slot]
        if not wanting:
            return False
        best = min(wanting, key=lambda running: (-running.job.priority, running.slots, running.key))
        if is_first:
            highest = max((priority for priority, _ in await self._waiting()), default=-1)
            waits_its_turn = best.slots > 0 or best.was_preempted
            if best.job.priority < highest or (best.job.priority == highest and waits_its_turn):
                return False
            if not best.wants_slot:
                return True  # it changed while others were examined: look again
        best.take_slot()
        return True

    async def _waiting(self) -> Sequence[tuple[int, str]]:
        context = self._context
        return await context.calls.store(context.store.waiting, context.fence, time.time(), context.quotas_of)

    async def _has_disk(self) -> bool:
        now = time.monotonic()
        if now >= self._disk_at:
            self._disk_at = now + LOOK_AT_DISK_EVERY_S
            await self._context.look_at_disk()
        return not self._context.disk_is_full

    async def _look_at_jobs(self) -> None:
        """Process the rows of running jobs, which may have been canceled or deleted."""
        context = self._context
        job_ids = {job_id for job_id, _ in self._running}
        if not job_ids:
            return
        versions = await context.calls.store(context.store.job_versions, job_ids)
        changed = {running.job.id for running in self._running.values() if self._has_changed(running, versions)}
        for job_id in changed & job_ids:
            job = await context.calls.store(context.store.job, job_id)
            for running in list(self._running.values()):
                if running.job.id == job_id:
                    running.saw(job)

    @staticmethod
    def _has_changed(running: ClaimedFrame, versions: Mapping[str, int]) -> bool:
        return versions.get(running.job.id) != running.job.version

    def _expired(self, job_id: str) -> None:
        for running in list(self._running.values()):
            if running.job.id == job_id:
                running.kill("expired")

    async def _ask_to_give_way(self) -> None:
        now = time.monotonic()
        if self._free_slots() > 0 or self._context.disk_is_full:
            return
        if now < self._preempt_at:
            self._look_later(self._preempt_at - now)
            return
        self._preempt_at = now + PREEMPT_SOONEST_S
        waiting = await self._waiting()
        if not waiting:
            return
        seen = [holder for running in self._running.values() for holder in running.holders()]
        for key in frames_to_preempt(seen, waiting, self._context.limits.time_slice_s):
            self._running[key[0], key[1]].preempt(key)

    async def _start_check(self) -> None:
        if self._check is not None and not self._check.done():
            return
        scene = await self._context.calls.store(self._context.store.next_check, self._context.fence)
        if scene is not None:
            self._check = self._spawn(check_scene(self._context, scene), "check")


ClaimedFrame = RunningFrame | ParallelFrame


def select_mode(context: Context, jobs: SharedJobs, claim: Claim, on_free: Callable[[], Awaitable[None]]) -> ClaimedFrame:
    """Return the frame, in parts if its job asks for that, there is more than one slot, and it was not begun in one piece."""
    job, frame = claim.job, claim.frame
    slots = context.executor.capacity().slots
    places = slots if job.parallel == "auto" else min(int(job.parallel or 1), slots)
    is_begun_whole = bool(frame.checkpoint_file) and not frame.merged
    most = rules_of(job.settings.get("stop", {})).most
    if places < 2 or is_begun_whole or most < 2 * FEWEST:
        return RunningFrame(context, jobs, claim, on_free)
    return ParallelFrame(context, jobs, claim, on_free, places)
