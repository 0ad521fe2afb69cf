"""The self-test of /readyz: everything is refused behind the walls, and it notices when one of them is missing."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from tests.service.sandbox.inside import needs

from primray_service.sandbox import layers, self_test, usable_layers, works

LANDLOCK, BUBBLEWRAP = ("rlimits", "landlock", "seccomp"), ("rlimits", "bubblewrap", "seccomp")


def test_layers_say_what_is_on_and_why_not() -> None:
    found = layers()
    assert list(found) == ["rlimits", "landlock", "seccomp", "bubblewrap"]
    assert all(state.startswith(("on", "off: ")) for state in found.values())
    assert found["rlimits"] == "on"


@pytest.mark.parametrize("walls", [LANDLOCK, BUBBLEWRAP, (*LANDLOCK, "bubblewrap")], ids=["landlock", "bubblewrap", "all"])
def test_nothing_gets_out(walls: tuple[str, ...], tmp_path: Path) -> None:
    found = self_test(tmp_path, needs(*walls))
    assert found.problem is None
    assert found.ok
    assert len(found.attempts) >= 23
    assert all(result.startswith("refused: ") for result in found.attempts.values())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("walls", "allowed"),
    [
        (("landlock",), {"fork", "send by UDP", "change the mode of a scene's file"}),
        (("bubblewrap",), {"fork", "execute a program", "make a symbolic link"}),
        (("seccomp",), {"read /etc/passwd", "read a file outside", "list the data directory", "read the server's environment"}),
        ((), {"connect by TCP", "connect to an abstract unix socket", "signal the server", "execute a program"}),
    ],
    ids=["landlock", "bubblewrap", "seccomp", "none"],
)
def test_a_missing_wall_is_noticed(walls: tuple[str, ...], allowed: set[str], tmp_path: Path) -> None:
    """Which also shows that every attempt would succeed if nothing stood in its way."""
    found = self_test(tmp_path, needs(*walls))
    assert not found.ok
    assert found.problem
    assert allowed <= {name for name, result in found.attempts.items() if result == "allowed"}


def test_what_counts_as_working() -> None:
    assert works(frozenset(LANDLOCK))
    assert works(frozenset(BUBBLEWRAP))
    assert not works(frozenset({"rlimits", "landlock", "bubblewrap"}))
    assert not works(frozenset({"rlimits", "seccomp"}))


def test_a_worker_that_cannot_start_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    needs("landlock")
    monkeypatch.setattr(sys.modules["primray_service.sandbox.self_test"], "_PROGRAM", "primray_service.no_such_module")
    found = self_test(tmp_path, frozenset({"rlimits", "landlock"}) & usable_layers())
    assert not found.ok
    assert "no_such_module" in (found.problem or "")
