"""How often a job's progress is told: often at first, when somebody watches; seldom later, so that a long render's history
stays short. Some 500 events in the first hour, 360 an hour afterwards."""

from __future__ import annotations

SOONEST_S = 0.5
MOST_A_SECOND = 50.0  # reports of all frames: more would keep claims and ends waiting
LATEST_S = 10.0
OF_ELAPSED = 0.02


class ReportThrottle:
    """Times are of any clock that only grows."""

    def __init__(self, began: float) -> None:
        self._began = began
        self._report_at = began
        self._event_at: dict[str, float] = {}

    def report_in(self, now: float) -> float:
        """Seconds until the job's row may be written again."""
        return max(self._report_at - now, 0.0)

    def reported(self, now: float, running: int = 1) -> None:
        """`running`: frames of all jobs, which share what the database takes."""
        self._report_at = now + max(SOONEST_S, running / MOST_A_SECOND)

    def takes_event(self, kind: str, now: float) -> bool:
        """Whether it is time for an event of this kind; if so, the next one's turn comes later."""
        if now < self._event_at.get(kind, self._began):
            return False
        self._event_at[kind] = now + min(max(OF_ELAPSED * (now - self._began), SOONEST_S), LATEST_S)
        return True
