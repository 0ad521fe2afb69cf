"""Files of packages by their digests: each tenant's own, counted once, gone with the last scene that has them."""

from __future__ import annotations

import pytest

from primray_service.limits import Quotas
from primray_service.store.base import Conflict, QuotaExceeded

from ..world import ANY, World, new_scene, scene_id

A, B, C = ("a" * 64, "b" * 64, "c" * 64)


def put(world: World, tenant: str, sha256: str, size: int = 100) -> bool:
    return world.store.put_content(tenant, sha256, size, world.tick(), ANY)


def scene_of(world: World, tenant: str, name: str, *digests: str) -> None:
    world.store.put_scene(new_scene(tenant, name, world.tick()), ANY, digests)


def stored(world: World, tenant: str = "t") -> int:
    return world.store.usage(tenant, world.now).stored_bytes


def test_a_tenant_has_what_it_sent_itself(world: World):
    assert put(world, "t", A)
    assert not put(world, "t", A)
    assert world.store.contents("t", [A, B], world.tick()) == {A: 100}
    assert world.store.contents("u", [A, B], world.tick()) == {}
    assert world.store.has_content("t", A)
    assert not world.store.has_content("u", A)
    assert put(world, "u", A)
    assert (stored(world, "t"), stored(world, "u")) == (100, 100)


def test_more_digests_than_one_statement_takes(world: World):
    digests = [f"{number:064x}" for number in range(1203)]
    for sha256 in digests[::400]:
        put(world, "t", sha256)
    assert set(world.store.contents("t", digests, world.tick())) == set(digests[::400])


def test_contents_are_counted_once_and_go_with_the_last_scene_that_has_them(world: World):
    for sha256 in (A, B):
        put(world, "t", sha256)
    scene_of(world, "t", "1", A, B)
    put(world, "t", C, 5)
    scene_of(world, "t", "2", A, C)
    assert stored(world) == 205 + 20
    assert sorted(world.store.contents_of_scene("t", scene_id("2"))) == [A, C]
    world.store.delete_scene("t", scene_id("1"))
    assert stored(world) == 105 + 10
    assert world.store.contents("t", [A, B, C], world.tick()) == {A: 100, C: 5}
    world.store.delete_scene("t", scene_id("2"))
    assert stored(world) == 0


def test_a_scene_of_what_the_tenant_lacks_is_not_made(world: World):
    put(world, "t", A)
    put(world, "u", B)
    with pytest.raises(Conflict):
        scene_of(world, "t", "1", A, B)
    assert world.store.scene("t", scene_id("1")) is None
    assert stored(world) == 100


def test_quotas_hold_for_contents(world: World):
    quotas = Quotas(stored_bytes=150)
    world.store.put_content("t", A, 100, world.tick(), quotas)
    with pytest.raises(QuotaExceeded, match="stored_bytes"):
        world.store.put_content("t", B, 51, world.tick(), quotas)
    assert not world.store.put_content("t", A, 100, world.tick(), quotas)
    assert world.store.put_content("t", B, 50, world.tick(), quotas)


def test_what_no_scene_has_is_forgotten_after_a_time(world: World):
    put(world, "t", A)
    put(world, "t", B)
    scene_of(world, "t", "1", B)
    later = world.tick(1000.0)
    put(world, "t", C)
    assert world.store.unused_contents(world.fence, later, 10) == [("t", A)]
    world.store.contents("t", [A], world.tick())  # somebody asks for it again, in between
    assert not world.store.forget_content("t", A, later)
    assert world.store.forget_content("t", A, world.tick())
    assert not world.store.forget_content("t", B, world.tick(1000.0))
    assert world.store.contents("t", [A, B], world.tick()) == {B: 100}
    assert stored(world) == 200 + 10
