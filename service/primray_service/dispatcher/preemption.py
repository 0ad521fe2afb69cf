"""Preemption: which running frames yield to which waiting jobs. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

Key = tuple[str, int, *tuple[int, ...]]  # job, frame, and for a part its first sample


@dataclass(frozen=True)
class Running:
    """Frame, or part of one, that holds a slot; `going`: it yields already, or ends soon anyway."""

    key: Key
    priority: int
    tenant: str
    ran_s: float  # seconds of sampling; loading does not count, or a frame that loads slowly would never progress
    going: bool = False


def frames_to_preempt(running: Sequence[Running], waiting: Sequence[tuple[int, str]], slice_s: float) -> list[Key]:
    """Return the keys of frames to preempt. `waiting`: the best waiting job of each tenant, as (priority, tenant).

    Higher priority preempts at once. Tenants of equal priority take turns if there are fewer slots than tenants, and otherwise
    share the slots as evenly as possible; a frame is preempted after it has run for its time slice.
    """
    slots = Counter(frame.tenant for frame in running if not frame.going)
    staying = [frame for frame in running if not frame.going]
    on_the_way = len(running) - len(staying)  # slots that will be free without preemption
    told = []
    for priority, tenant in sorted(waiting, key=lambda job: (-job[0], slots[job[1]], job[1])):
        if on_the_way > 0:
            on_the_way -= 1
            continue
        lower = [frame for frame in staying if frame.priority < priority]
        equal = [frame for frame in staying if frame.priority == priority and _is_fairer(slots, frame.tenant, tenant)]
        equal = [frame for frame in equal if frame.ran_s >= slice_s]
        candidates = lower or equal
        if not candidates:
            continue
        chosen = min(candidates, key=lambda frame: (frame.priority, -slots[frame.tenant], -frame.ran_s, frame.key))
        told.append(chosen.key)
        staying.remove(chosen)
        slots[chosen.tenant] -= 1
        slots[tenant] += 1
    return told


def _is_fairer(slots: Counter[str], running: str, waiting: str) -> bool:
    """Return whether moving one slot from one tenant to the other is fairer. With a difference of one the slot would alternate,
    which is fair only if the other has none."""
    if running == waiting:
        return False
    return slots[waiting] == 0 or slots[running] - slots[waiting] >= 2
