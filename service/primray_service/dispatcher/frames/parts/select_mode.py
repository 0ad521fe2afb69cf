"""Choice whether a claimed frame is rendered as parts."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from primray.distributed.planner import FEWEST

from ....store.base import Claim
from ...context import Context
from ..running import RunningFrame
from ..shared_jobs import SharedJobs
from .parallel_frame import ParallelFrame
from .plan import rules_of

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
