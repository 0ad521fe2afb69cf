"""Rate of a job's progress reports: high at first, when somebody watches; low later, so that a long render's history stays
short. Some 500 events in the first hour, 360 an hour afterwards."""

from __future__ import annotations

SOONEST_S = 0.5
MOST_A_SECOND = 50.0  # reports of all frames; more would delay claims and ends
LATEST_S = 10.0
OF_ELAPSED = 0.02


class ReportThrottle:
    """Rate limit of one job. Times are of any monotonic clock."""

    def __init__(self, began: float) -> None:
        self._began = began
        self._report_at = began
        self._event_at: dict[str, float] = {}

    def report_in(self, now: float) -> float:
        """Return the seconds until the job's row may be written again."""
        return max(self._report_at - now, 0.0)

    def reported(self, now: float, running: int = 1) -> None:
        """Record a report; `running` is the number of running frames of all jobs, which share the database's capacity."""
        self._report_at = now + max(SOONEST_S, running / MOST_A_SECOND)

    def takes_event(self, kind: str, now: float) -> bool:
        """Return whether an event of this kind is due; if so, the next one is due later."""
        if now < self._event_at.get(kind, self._began):
            return False
        self._event_at[kind] = now + min(max(OF_ELAPSED * (now - self._began), SOONEST_S), LATEST_S)
        return True
