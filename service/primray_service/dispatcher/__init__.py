"""The dispatcher: holds the lease, gives frames to the executor, adopts what comes back.

    dispatcher.py   takes the lease when it can be had, and lives one term after another
    lease.py        the lease, and when it is over
    term.py         one hold of it: rounds of claiming, checking, looking whom to cancel, asking to give way
    turns.py        whose frame is next among tenants; giving_way.py: who gives way to whom
    running.py      a frame that runs: its chunk, and what comes from it; frame_end.py: writing down how it ended
    chunks.py       commands and files of chunks; chunk_run.py, inbox.py, messages.py: one that runs, what it says, checked
    endings.py      what becomes of a frame whose chunk ended; which problem that is
    reports.py, pace.py, totals.py   how a job is doing, how often that is told, what its frames add up to
    adoption.py     files that workers leave, durably
    checks.py, check_run.py          the check of a scene
    retention.py    what is not kept
    calls.py        the store and the disk from the event loop; parts.py: what all of these share; metrics.py: counts

What makes a crash harmless: a file is on the disk before a row names it; names are not used twice; rows change under the
fence of the lease; and what is lost is rendered again, to the same bits.
"""

from __future__ import annotations

from .dispatcher import Dispatcher

__all__ = ["Dispatcher"]
