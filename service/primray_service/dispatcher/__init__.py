"""The dispatcher: holds the lease, gives frames to the executor, adopts the results.

    dispatcher.py   acquires the lease when it is free, and runs a scheduler while it is held
    lease.py        the lease and its renewal
    scheduler.py    one hold of the lease: claims, checks, cancellations, preemption, and which frames are rendered as parts
    frames/         frames that run, their progress and how they end
    parts/          a frame that is rendered as several parts at a time
    chunks/         chunks: their commands and input files, messages from workers, adoption of the files that they leave
    checks.py       the check of a scene
    retention.py    removal of what is expired or unused
    context.py      what all of these share: calls of the store and the disk, counters

queue/order.py decides whose frame is next, and which running frames are preempted.

Crash safety: a file is on the disk before a row names it; names are not reused; rows change under the fence of the lease; and
lost samples are rendered again, with the same bits.
"""

from __future__ import annotations

from .dispatcher import Dispatcher

__all__ = ["Dispatcher"]
