"""Ids of things by their paths, also where hashes clash, and things as JSON."""

from __future__ import annotations

import json

from primray.images.cryptomatte import hash_of
from primray.labels.things import Thing, ids_of_paths, ids_within, thing_of_json

CLASHING = "/world/prop4343", "/world/prop40929"  # found by trying


def test_the_id_of_a_thing_is_the_hash_of_its_path() -> None:
    ids, clashes = ids_of_paths(["/b", "/a"], {})
    assert ids == {"/a": hash_of("/a"), "/b": hash_of("/b")}
    assert clashes == {}


def test_the_second_of_equal_hashes_has_the_next_id() -> None:
    first, second = CLASHING
    assert hash_of(first) == hash_of(second) == 299511252
    ids, clashes = ids_of_paths([first, second, "/a"], {})
    assert (ids[second], ids[first]) == (299511252, 299511253)  # in the order of paths
    assert clashes == {first: second}


def test_ids_that_are_fixed_stay_whatever_else_is_in_the_picture() -> None:
    first, second = CLASHING
    fixed = {first: 299511253}
    assert ids_of_paths([first], fixed) == ({first: 299511253}, {})
    assert ids_of_paths([second, first], fixed) == ({first: 299511253, second: 299511252}, {})


def test_ids_of_other_things_are_not_taken() -> None:
    ids, clashes = ids_of_paths(["/a"], {"/gone": hash_of("/a")})
    assert ids == {"/a": hash_of("/a") + 1}
    assert clashes == {"/a": "/gone"}


def test_things_are_json_and_back() -> None:
    thing = Thing(7, "/a", "class", "car", 1, parent=3, pixels_visible=4, box_tight=(1, 2, 3, 4))
    says = thing.as_json()
    assert says["class"] == "car"
    assert says == json.loads(json.dumps(says))
    assert thing_of_json(says) == thing


def test_a_thing_holds_those_below_it_in_its_taxonomy() -> None:
    car, wheel, hub = (Thing(n, f"/{n}", "class", "x", 1, parent=n - 1 or None) for n in (1, 2, 3))
    part = Thing(4, "/4", "part", "x", 1, parent=1)
    assert ids_within(car, [car, wheel, hub, part]) == {1, 2, 3}
    assert ids_within(wheel, [car, wheel, hub, part]) == {2, 3}
