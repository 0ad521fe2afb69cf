"""The dispatcher: holds the lease, gives frames to the executor, adopts what comes back.

    dispatcher.py   takes the lease when it can be had, and runs a scheduler while it is held
    lease.py        the lease, and when it is over
    scheduler.py    rounds of claiming, checking, looking whom to cancel, asking to give way
    giving_way.py   who gives way to whom (waiting/turns.py: whose frame is next)
    frames/         a frame that runs, and writing down how it is doing and how it ended
    chunks/         commands and files of chunks; what one that runs says, checked; adopting the files that it leaves
    checks.py       the check of a scene
    retention.py    what is not kept
    context.py      what all of these share; calls.py: the store and the disk from the event loop; metrics.py: counts

What makes a crash harmless: a file is on the disk before a row names it; names are not used twice; rows change under the
fence of the lease; and what is lost is rendered again, to the same bits.
"""

from __future__ import annotations

from .dispatcher import Dispatcher

__all__ = ["Dispatcher"]
