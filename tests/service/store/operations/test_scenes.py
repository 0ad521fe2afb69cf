"""Scenes: a tenant's rows of bytes that lie there once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from primray_service.jobs import JobState, SceneState
from primray_service.limits import Quotas
from primray_service.store.base import Conflict, QuotaExceeded

from ..world import ANY, World, any_quotas, new_job, new_scene, scene_id

PROBLEM = {"type": "/problems/asset-missing", "title": "..", "status": 422, "detail": "tex.png", "retryable": False}


def test_the_same_bytes_are_the_same_scene(world: World):
    scene = new_scene(name="a", at=world.tick())
    assert world.store.put_scene(scene, ANY) == (scene, True)
    assert world.store.put_scene(scene, ANY) == (scene, True)  # the call repeated
    again, is_new = world.store.put_scene(replace(scene, name="other.usda", created_at=world.tick(), used_at=world.now), ANY)
    assert not is_new
    assert again == replace(scene, used_at=scene.used_at)
    assert world.scene().used_at == world.now
    assert world.store.scene("u", scene.id) is None
    assert world.store.has_scene(scene.id)
    assert not world.store.has_scene(scene_id("b"))
    assert world.store.usage("t", world.now).stored_bytes == 10


def test_file_names_that_no_database_takes(world: World):
    scene = new_scene()
    world.store.put_scene(replace(scene, name="a\0b\ud800.usda"), ANY)
    assert world.scene().name == "a\ufffdb\ufffd.usda"


def test_stored_bytes_are_within_the_quota(world: World):
    quotas = Quotas(stored_bytes=100)
    world.store.put_scene(new_scene(stored_bytes=60), quotas)
    with pytest.raises(QuotaExceeded, match="stored_bytes"):
        world.store.put_scene(new_scene(name="b", stored_bytes=41), quotas)
    world.store.put_scene(new_scene(name="b", stored_bytes=40), quotas)
    assert world.store.put_scene(new_scene(stored_bytes=60), quotas)[0].id == scene_id()
    world.store.put_scene(new_scene("u", stored_bytes=60), quotas)


def test_a_check_answers_for_all_tenants(world: World):
    for tenant in ("t", "u"):
        world.store.put_scene(new_scene(tenant, at=world.tick()), ANY)
        world.store.create_job(new_job(tenant, world.tick()), [None], ANY)
    world.store.put_scene(new_scene(name="b", at=world.tick()), ANY)
    assert getattr(world.store.next_check(world.fence), "id", None) == scene_id()
    warning = {"code": "x", "detail": "y"}
    world.store.scene_checked(
        world.fence, scene_id(), world.tick(), facts={"cameras": ["/c"]}, warnings=[warning], problem=None
    )
    for tenant in ("t", "u"):
        scene = world.scene(tenant)
        assert (scene.state, scene.facts, scene.warnings) == (SceneState.READY, {"cameras": ["/c"]}, [warning])
    assert {world.claim().job.tenant, world.claim().job.tenant} == {"t", "u"}
    late, _ = world.store.put_scene(new_scene("v", at=world.tick()), ANY)
    assert (late.state, late.facts) == (SceneState.READY, {"cameras": ["/c"]})
    assert getattr(world.store.next_check(world.fence), "id", None) == scene_id("b")
    world.store.scene_checked(world.fence, scene_id("b"), world.tick(), facts={}, warnings=[], problem=None)
    assert world.store.next_check(world.fence) is None


def test_jobs_of_a_rejected_scene_fail_with_its_problem(world: World):
    world.store.put_scene(new_scene(), ANY)
    webhook = {"url": "https://x", "events": ["completed"], "secret": "s"}
    job, _ = world.store.create_job(new_job(webhook=webhook), [0.0, 1.0], ANY)
    world.store.scene_checked(world.fence, scene_id(), world.tick(), facts={}, warnings=[], problem=PROBLEM)
    failed = world.get(job)
    assert (failed.state, failed.error) == (JobState.FAILED, {**PROBLEM, "attempt": 1})
    assert world.scene().problem == PROBLEM
    assert world.claims_nothing()
    assert [w.event for w in world.store.webhooks(job.id)] == ["completed"]
    world.store.scene_checked(world.fence, scene_id(), world.tick(), facts={"late": 1}, warnings=[], problem=None)
    assert world.scene().state == SceneState.REJECTED  # the first check's word stands


def test_a_scene_in_use_stays(world: World):
    job = world.job()
    with pytest.raises(Conflict):
        world.store.delete_scene("t", scene_id())
    world.store.request_cancel(job.id, world.tick())
    assert world.store.delete_scene("t", scene_id()) is True
    with pytest.raises(KeyError):
        world.store.delete_scene("t", scene_id())
    assert world.get(job).state == JobState.CANCELED


def test_bytes_are_nobodys_when_the_last_row_goes(world: World):
    for tenant in ("t", "u"):
        world.ready_scene(tenant)
    assert world.store.delete_scene("t", scene_id()) is False
    assert world.store.delete_scene("u", scene_id()) is True


def test_what_nobody_used_for_long(world: World):
    for name in "abcd":
        world.ready_scene(name=name)
    world.store.put_scene(new_scene(name="e", at=world.now), ANY)
    kept = world.finished(scene="a")
    world.tick(1000)
    since = world.now
    world.store.put_scene(new_scene(name="b", at=world.tick()), ANY)
    assert [s.id for s in world.store.unused_scenes(world.fence, since, 10)] == [scene_id("c"), scene_id("d")]
    assert [s.id for s in world.store.unused_scenes(world.fence, since, 1)] == [scene_id("c")]
    world.store.delete_job(kept.id)
    assert scene_id("a") in [s.id for s in world.store.unused_scenes(world.fence, since, 10)]


def test_pages_of_scenes(world: World):
    for name in "0123456789abcdef":
        world.store.put_scene(new_scene(name=name, at=world.tick(0.5)), ANY)
    world.store.put_scene(new_scene("u", "a"), ANY)
    seen, cursor = [], None
    while True:
        items, cursor = world.store.scenes("t", 5, cursor)
        seen += [scene.id[7] for scene in items]
        if cursor is None:
            break
        assert len(items) == 5
    assert "".join(seen) == "fedcba9876543210"
    with pytest.raises(ValueError, match="cursor"):
        world.store.scenes("t", 5, world.store.jobs.__name__)


def test_a_scene_that_is_checked_while_a_job_is_made(world: World):
    """Whichever comes first: the job is claimed, or failed; none waits for ever."""
    from concurrent.futures import ThreadPoolExecutor

    names = "0123456789abcdef"
    for name in names:
        world.store.put_scene(new_scene(name=name), ANY)

    def check(name: str) -> None:
        problem = PROBLEM if name in "13579bdf" else None
        world.store.scene_checked(world.fence, scene_id(name), world.now, facts={}, warnings=[], problem=problem)

    with ThreadPoolExecutor(4) as pool:
        done = [pool.submit(check, name) for name in names]
        made = [pool.submit(world.store.create_job, new_job(scene=name), [None], ANY) for name in names]
        for checked in done:
            checked.result()
        for one in made:
            one.result()
    while world.store.claim_frame(world.fence, world.tick(), any_quotas):
        pass
    states = [world.get(one.result()[0]).state for one in made]
    assert states == [JobState.FAILED if name in "13579bdf" else JobState.PREPARING for name in names]
