"""Progress of a frame in parts, in the form of a frame that one worker renders."""

from __future__ import annotations

from collections.abc import Iterable

from primray.settings import SAMPLE_BLOCK

from ....jobs import Json
from ...chunks.inbox import Inbox
from .part_run import PartRun
from .plan import Plan

# Settings in which a part differs from its frame.
OF_FRAME = ("spp", "target_error", "time_limit_s", "sample_range")


class PartsProgress:
    """Combined messages of all parts: the frame's news."""

    def __init__(self, now: float, convergence: list[Json], asked: Json) -> None:
        self.inbox = Inbox(now, convergence)
        self._asked = asked  # the frame's settings
        self._rays: dict[int, int] = {}  # of done and of running parts
        self._merged_rays = 0
        self.error: Json | None = None  # of the merged samples, as in progress documents

    def hear(self, runs: Iterable[PartRun], now: float) -> None:
        """Take over the messages of the parts."""
        for run in runs:
            heard = run.inbox
            if heard is None or not heard.has_news:
                continue
            heard.has_news = False
            self._take(heard, run.part.first, now)

    def _take(self, heard: Inbox, first: int, now: float) -> None:
        inbox = self.inbox
        inbox.has_news = True
        if heard.effective is not None and inbox.effective is None:
            settings = heard.effective.get("settings", {})
            frame = {name: self._asked.get(name) for name in OF_FRAME} | {"adaptive": False}
            inbox.effective = heard.effective | {"settings": settings | frame}
        inbox.warnings += heard.warnings
        heard.warnings = []
        if heard.sampling_since is not None and inbox.sampling_since is None:
            inbox.sampling_since = now
            inbox.is_urgent = True
        if inbox.phase != "sampling":
            inbox.phase = heard.phase or inbox.phase
        if heard.progress is not None:
            self._rays[first] = int(heard.progress.get("rays") or 0)

    def merged(self, rays: int, end: int) -> None:
        self._merged_rays = rays
        self._rays = {first: n for first, n in self._rays.items() if first >= end}

    def progress(self, plan: Plan, running: list[PartRun], elapsed_s: float) -> None:
        """Update the progress for the frame's row and for clients."""
        ledger, rules, sample_s = plan.ledger, plan.rules, plan.costs.sample_s
        now = [run.inbox.progress for run in running if run.inbox is not None and run.inbox.progress is not None]
        taken = ledger.taken() + sum(float(said.get("samples_done") or 0.0) for said in now)
        end = plan.expected_end
        parts = [taken / end] if end else []
        if rules.seconds:
            parts.append(elapsed_s / rules.seconds)
        left = None
        if end is not None and rules.seconds is None and sample_s is not None and running:
            left = max(end - taken, 0.0) * sample_s / len(running)
        self.inbox.progress = {
            "fraction": min(max(parts, default=0.0), 0.99),
            "samples_done": taken,
            "samples_min": ledger.merged,
            "samples_max": ledger.given,
            "rays": self._merged_rays + sum(self._rays.values()),
            "rays_per_s": sum(float(said.get("rays_per_s") or 0.0) for said in now),
            "elapsed_s": elapsed_s,
            "pass": ledger.merged // SAMPLE_BLOCK,
            "error": self.error,
            "eta_s": left,
            "eta_ci95": None,
        }
