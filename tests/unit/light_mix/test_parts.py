"""Names of the parts of lights."""

from __future__ import annotations

from primray.light_mix.parts import names_of


def test_names_are_the_ends_of_paths_that_tell_lights_apart() -> None:
    labels = ["/a/lamp", "/b/lamp", "/b/sun", "key.warm", "/rest"]
    assert list(names_of(labels).values()) == ["a_lamp", "b_lamp", "sun", "key_warm", "rest_"]


def test_no_two_names_are_equal() -> None:
    labels = ["/a/b_c", "/a_b/c", "/b/c", "c", "/x/c"]
    names = list(names_of(labels).values())
    assert len(set(names)) == len(names)
