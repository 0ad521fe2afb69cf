"""Who comes first, how many frames are ahead, and when a turn comes."""

from __future__ import annotations

from primray_service.queue.estimates import Active, Place, positions_of
from primray_service.queue.order import Waiting, in_order


def waiting(
    name: str, *, priority: int = 50, tenant: str = "a", at: float = 0.0, frames: int = 1, begun: bool = False
) -> Waiting:
    return Waiting(name, tenant, priority, at, frames, begun, ("scene", name))


def order(*jobs: Waiting, **running: int) -> list[str]:
    return [job.job_id for job in in_order(jobs, running)]


def test_larger_priorities_first_then_age() -> None:
    jobs = waiting("old", at=1), waiting("new", at=2), waiting("urgent", priority=90, at=3)
    assert order(*jobs) == order(*reversed(jobs)) == ["urgent", "old", "new"]


def test_tenants_take_turns() -> None:
    many = [waiting(f"a{i}", at=i) for i in range(3)]
    late = [waiting(f"b{i}", tenant="b", at=10 + i) for i in range(2)]
    assert order(*many, *late) == ["a0", "b0", "a1", "b1", "a2"]
    assert order(*many, *late, a=1) == ["b0", "a0", "b1", "a1", "a2"]


def test_a_job_of_many_frames_takes_many_turns() -> None:
    assert order(waiting("long", frames=9), waiting("next", at=1), waiting("other", tenant="b", at=2)) == [
        "long",
        "other",
        "next",
    ]


SECONDS = {"low": 7.0, "high": 4.0, "last": 1.0}


def placed(*jobs: Waiting, active: tuple[Active, ...] = (), slots: int = 1, known: bool = True) -> dict[str, Place]:
    return dict(positions_of(in_order(jobs, {}), active, slots, lambda job: SECONDS[job.job_id] if known else None))


THREE = waiting("low", priority=10, at=1, frames=2), waiting("high", priority=90, at=2, frames=3), waiting("last", at=3)


def test_three_jobs_of_several_priorities() -> None:
    found = placed(*THREE, active=(Active(90, 1, 30.0),))
    assert found == {"high": Place(1, 1, 30.0), "last": Place(2, 4, 42.0), "low": Place(3, 5, 43.0)}


def test_what_gives_way_is_not_waited_for() -> None:
    found = placed(*THREE, active=(Active(50, 1, 30.0),))
    assert found == {"high": Place(1, 0, 0.0), "last": Place(2, 4, 42.0), "low": Place(3, 5, 43.0)}


def test_slots_share_the_work() -> None:
    found = placed(*THREE, active=(Active(90, 2, 30.0), Active(90, 1, None)), slots=4)
    assert found["high"] == Place(1, 3, 0.0)  # a slot is free
    assert found["last"] == Place(2, 6, None)
    found = placed(*THREE, active=(Active(90, 2, 30.0),), slots=2)
    assert found["high"] == Place(1, 2, 30.0)
    assert found["last"] == Place(2, 5, 36.0)


def test_what_is_not_known_is_not_guessed() -> None:
    found = placed(*THREE, active=(Active(90, 1, None),))
    assert [place.start_s for place in found.values()] == [None] * 3
    found = placed(*THREE, known=False)
    assert [place.start_s for place in found.values()] == [0.0, None, None]
    assert [place.place for place in found.values()] == [1, 2, 3]


def test_frames_of_a_job_that_has_begun_are_ahead_and_have_no_place() -> None:
    found = placed(waiting("x", frames=8, begun=True), waiting("last", at=1), active=(Active(50, 1, 20.0),))
    assert found == {"last": Place(1, 9, 20.0)}
