"""Which running frames give way to which waiting jobs. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

Key = tuple[str, int, *tuple[int, ...]]  # job and frame, and the first sample of a part


@dataclass(frozen=True)
class Running:
    """A frame, or a part of one, that takes a slot; `going`: it was told to give way already, or ends soon anyway."""

    key: Key
    priority: int
    tenant: str
    ran_s: float  # seconds of sampling; loading does not count, or who loads long would get nowhere
    going: bool = False


def who_gives_way(running: Sequence[Running], waiting: Sequence[tuple[int, str]], slice_s: float) -> list[Key]:
    """Keys of frames to be told. `waiting`: the best waiting job of each tenant, as (priority, tenant).

    Higher priority goes first at once. Among equals, tenants take turns where there are fewer slots than tenants, and else
    share them as evenly as can be; a frame that gives way has had its time.
    """
    slots = Counter(frame.tenant for frame in running if not frame.going)
    staying = [frame for frame in running if not frame.going]
    on_the_way = len(running) - len(staying)  # slots that will be free without anybody giving way
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
    """Whether one slot less for one tenant and one more for the other is fairer; a difference of one moves to and fro, which
    is fair only to who has none."""
    if running == waiting:
        return False
    return slots[waiting] == 0 or slots[running] - slots[waiting] >= 2
