"""When parts of a frame are put together although nothing waits for that: for previews, and its error so far. Pure."""

from __future__ import annotations

GUESS_S = 0.5  # that a merge takes, before there was one
SHARE, SHARE_WATCHED = 0.02, 0.1  # of one place's time, for merges
WATCHED_S = 15.0  # after somebody asked for a preview
MOST_WAITING = 2  # parts for each place: films that are on their way at once


class MergePace:
    """Times are of any clock that only grows."""

    def __init__(self, now: float, places: int) -> None:
        self._most_waiting = MOST_WAITING * places
        self._took_s = GUESS_S
        self._since = now  # the end of the last merge
        self._watched_until = now

    def is_watched(self, now: float) -> None:
        """Somebody looks."""
        self._watched_until = now + WATCHED_S

    def began(self, now: float) -> None:
        self._since = now

    def ended(self, now: float) -> None:
        self._took_s, self._since = now - self._since, now

    def is_due(self, waiting: int, now: float) -> bool:
        """With so many parts that could be merged."""
        share = SHARE_WATCHED if now < self._watched_until else SHARE
        return waiting > 0 and (waiting >= self._most_waiting or now - self._since >= self._took_s / share)
