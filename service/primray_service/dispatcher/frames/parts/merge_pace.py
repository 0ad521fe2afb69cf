"""Pace of merges that nothing waits for: they update previews and the current error. Pure."""

from __future__ import annotations

GUESS_S = 0.5  # duration of a merge before one was measured
SHARE, SHARE_WATCHED = 0.02, 0.1  # share of one slot's time for merges
WATCHED_S = 15.0  # after a client asked for a preview
MOST_WAITING = 2  # parts per slot, which limits the films held at once


class MergePace:
    """Pace of a frame's merges. Times are of any monotonic clock."""

    def __init__(self, now: float, places: int) -> None:
        self._most_waiting = MOST_WAITING * places
        self._took_s = GUESS_S
        self._since = now  # end of the last merge
        self._watched_until = now

    def is_watched(self, now: float) -> None:
        """Record that a client watches."""
        self._watched_until = now + WATCHED_S

    def began(self, now: float) -> None:
        self._since = now

    def ended(self, now: float) -> None:
        self._took_s, self._since = now - self._since, now

    def is_due(self, waiting: int, now: float) -> bool:
        """Return whether a merge is due with that many parts ready for it."""
        share = SHARE_WATCHED if now < self._watched_until else SHARE
        return waiting > 0 and (waiting >= self._most_waiting or now - self._since >= self._took_s / share)
