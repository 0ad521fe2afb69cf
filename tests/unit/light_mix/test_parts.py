"""Names of the parts of lights."""

from __future__ import annotations

from primray.light_mix.parts import names_of
from primray.settings.light_mixes import weights_of_text


def test_names_are_the_ends_of_paths_that_tell_lights_apart() -> None:
    labels = ["/a/lamp", "/b/lamp", "/b/sun", "key.warm", "/rest"]
    assert list(names_of(labels).values()) == ["a_lamp", "b_lamp", "sun", "key_warm", "rest_"]


def test_no_two_names_are_equal() -> None:
    labels = ["/a/b_c", "/a_b/c", "/b/c", "c", "/x/c"]
    names = list(names_of(labels).values())
    assert len(set(names)) == len(names)


def test_names_can_be_written_in_mixes_lists_and_commands() -> None:
    """A name is copied into a shell's command by the page: nothing in it may end the text or run something."""
    labels = ["my key, at=dusk", "schl\u00fcssel\u3000\u9375", "$(rm -rf ~)`x`\"'\\", "a\tb\nc", "/sets/key-light:2", "a+b/c"]
    names = names_of(labels)
    assert len(set(names.values())) == len(labels)
    for label, name in names.items():
        assert weights_of_text(f"{name}=0.5") == {name: (0.5, 0.5, 0.5)}
        assert name.split(",") == [name]
        assert not set(name) & set("\"'`$\\!;&|<>()=., "), label
    assert names["schl\u00fcssel\u3000\u9375"] == "schl\u00fcssel_\u9375"
    assert names["/sets/key-light:2"] == "key-light:2"
