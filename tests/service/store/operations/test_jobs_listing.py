"""Pages of jobs: complete, in order, whatever comes and goes meanwhile, and as quick at the end as at the start."""

from __future__ import annotations

import base64
import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from primray_service.jobs import JobState
from primray_service.store import SqlStore
from primray_service.store.base import JobFilter
from primray_service.store.database.rows import read_cursor, write_cursor

from ..world import ANY, T0, World, new_job, scene_id


def all_pages(store: SqlStore, where: JobFilter, limit: int, newest_first: bool = True, tenant: str = "t") -> list[str]:
    seen: list[str] = []
    cursor = None
    while True:
        page = store.jobs(tenant, where, limit, cursor, newest_first)
        seen += [job.id for job in page.items]
        assert len(page.items) == limit or page.next_cursor is None
        if page.next_cursor is None:
            return seen
        cursor = page.next_cursor


@pytest.fixture
def many(world: World) -> dict[str, list[str]]:
    """25 jobs, in pairs of the same time; ids by what is to find them, oldest first."""
    world.ready_scene(name="a")
    world.ready_scene(name="b")
    made = []
    for number in range(25):
        labels = {"shot": str(number % 5), "odd": str(number % 2)}
        job = new_job(at=T0 + number // 2, scene="ab"[number % 2], labels=labels)
        made.append(world.store.create_job(job, [None], ANY)[0])
    for job in made[::3]:
        world.store.request_cancel(job.id, world.tick())
    world.job("u")
    ids = [job.id for job in made]
    canceled = set(ids[::3])
    return {
        "all": ids,
        "canceled": [i for i in ids if i in canceled],
        "queued": [i for i in ids if i not in canceled],
        "shot 3": [i for n, i in enumerate(ids) if n % 5 == 3],
        "shot 3 odd": [i for n, i in enumerate(ids) if n % 5 == 3 and n % 2],
        "shot 3 canceled": [i for n, i in enumerate(ids) if n % 5 == 3 and i in canceled],
        "scene b": [i for n, i in enumerate(ids) if n % 2],
        "scene b queued": [i for n, i in enumerate(ids) if n % 2 and i not in canceled],
        "none": [],
    }


CANCELED, QUEUED = frozenset({JobState.CANCELED}), frozenset({JobState.QUEUED})
FILTERS = {
    "all": [JobFilter(), JobFilter(states=frozenset(JobState)), JobFilter(states=CANCELED | QUEUED | {JobState.FAILED})],
    "canceled": [JobFilter(states=CANCELED), JobFilter(states=CANCELED | {JobState.FAILED})],
    "queued": [JobFilter(states=QUEUED)],
    "shot 3": [JobFilter(labels={"shot": "3"})],
    "shot 3 odd": [JobFilter(labels={"shot": "3", "odd": "1"}), JobFilter(labels={"shot": "3"}, scene_id=scene_id("b"))],
    "shot 3 canceled": [
        JobFilter(labels={"shot": "3"}, states=CANCELED),
        JobFilter(labels={"shot": "3"}, states=CANCELED | {JobState.FAILED}),
    ],
    "scene b": [JobFilter(scene_id=scene_id("b"))],
    "scene b queued": [JobFilter(scene_id=scene_id("b"), states=QUEUED)],
    "none": [
        JobFilter(labels={"shot": "9"}),
        JobFilter(labels={"none": ""}),
        JobFilter(scene_id="\0"),
        JobFilter(states=frozenset({JobState.FAILED, JobState.EXPIRED})),
        JobFilter(labels={"shot": "3", "odd": "2"}),
    ],
}


def test_every_job_is_on_one_page(world: World, many: dict[str, list[str]]):
    for name, wheres in FILTERS.items():
        for where, limit in itertools.product(wheres, (1, 4, 25, 100)):
            assert all_pages(world.store, where, limit) == many[name][::-1], (name, limit)
            assert all_pages(world.store, where, limit, newest_first=False) == many[name], (name, limit)
    assert len(all_pages(world.store, JobFilter(), 3, tenant="u")) == 1
    assert not all_pages(world.store, JobFilter(), 3, tenant="v")


def test_pages_go_on_where_they_ended_though_jobs_come_and_go(world: World, many: dict[str, list[str]]):
    page = world.store.jobs("t", JobFilter(), 10, None)
    world.job()
    world.store.request_cancel(page.items[-1].id, world.tick())
    world.store.delete_job(page.items[-1].id)
    page = world.store.jobs("t", JobFilter(), 10, page.next_cursor)
    assert [job.id for job in page.items] == many["all"][::-1][10:20]


def test_a_cursor_of_the_other_direction_or_of_nothing(world: World):
    for _ in range(3):
        world.job()
    newest = world.store.jobs("t", JobFilter(), 1, None).next_cursor
    for cursor in (
        newest,
        "",
        "!",
        "e30",
        "\0",
        "ü",
        write_cursor(1.0, "a\0b", "oldest"),
        write_cursor(1.0, "\ud800", "oldest"),
    ):
        with pytest.raises(ValueError, match="cursor"):
            world.store.jobs("t", JobFilter(), 1, cursor, newest_first=False)


@settings(max_examples=300)
@given(st.one_of(st.text(), st.binary().map(lambda b: base64.urlsafe_b64encode(b).decode()), st.from_type(type(None))))
def test_what_is_no_cursor_is_refused(text: str | None):
    with pytest.raises(ValueError, match="cursor"):
        read_cursor(text or "", "newest")


@given(st.floats(allow_nan=False, allow_infinity=False), st.text(st.characters(min_codepoint=33, max_codepoint=126)))
def test_cursors_come_back(at: float, row_id: str):
    assert read_cursor(write_cursor(at, row_id, "newest"), "newest") == (at, row_id)


def test_the_queue_and_the_pages_are_read_from_indexes(world: World):
    """Whatever the length: no statement of a claim, a page or the counts reads a table from end to end."""
    if not world.store._db.is_sqlite:
        pytest.skip("SQLite's plans do not depend on what is in the tables")
    from sqlalchemy import event

    for number in range(5):
        world.job(f"t{number % 2}", labels={"a": "b"})
    plans: dict[str, list[str]] = {}

    def explain(connection, cursor, statement, parameters, context, executemany):
        if statement.lstrip().upper().startswith(("SELECT", "WITH", "UPDATE", "DELETE")) and not executemany:
            found = connection.connection.driver_connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters)
            plans[statement] = [row[3] for row in found]

    for engine in (world.store._db._reader, world.store._db._writer):
        event.listen(engine, "before_cursor_execute", explain)
    frame = world.claim().frame
    world.begin(frame)
    world.end(frame)
    for wheres in FILTERS.values():
        for where in wheres:
            world.store.jobs("t0", where, 10, write_cursor(T0, "job_", "newest"))
    world.store.waiting(world.fence)
    world.store.expire(world.fence, world.now, 10)
    world.store.next_check(world.fence)
    world.store.due_webhooks(world.fence, world.now, 10)
    world.store.delete_job(frame.job_id)
    assert len(plans) > 30
    few = ("SCAN leader", "SCAN steps", "SCAN anon", "SCAN CONSTANT", "ix_jobs_active", "ix_scenes_to_check")  # rows, always
    scans = [
        (step, statement)
        for statement, steps in plans.items()
        for step in steps
        if step.startswith("SCAN") and not any(name in step for name in few)
    ]
    assert not scans, "\n".join(map(str, scans))
