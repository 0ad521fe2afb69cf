"""Whatever field of a crate is of whatever other type: reading it ends in a description, or in an error of the scene's."""

from __future__ import annotations

from pathlib import Path

import pytest

from .crates import words
from .fields import base, of_everything
from .tried import Outcomes, defects, tried

QUICK = ("string", "float", "token[]")
EVERY = 7  # field is tried in the quick test
ALLOWED = {"stage-open", "time-metadata", "damaged-stage"}


def written(folder: Path, kinds: tuple[str, ...], every: int) -> Outcomes:
    for number, kind, crate in of_everything(base()):
        if kind in kinds and int(number) % every == 0:
            (folder / f"{number} {kind}.usdc").write_bytes(crate.data)
    return tried(folder, 3000)


def check(outcomes: Outcomes) -> None:
    assert defects(outcomes) == {}
    assert {outcome["error"] for outcome in outcomes.values() if "error" in outcome} <= ALLOWED


def test_some_of_them(tmp_path: Path) -> None:
    outcomes = written(tmp_path, QUICK, EVERY)
    assert len(outcomes) > 60
    check(outcomes)


@pytest.mark.long
@pytest.mark.parametrize("kind", words())
def test_all_of_them(kind: str, tmp_path: Path) -> None:
    check(written(tmp_path, (kind,), 1))


def test_names_that_are_not_text(tmp_path: Path) -> None:
    """Each name of a crate in turn: of fields, types, prims, properties, tokens."""
    crate = base()
    names = crate.names
    for at in range(0, len(names), 3):
        damaged = [name[:1] + b"\xd0" + name[2:] if i == at else name for i, name in enumerate(names)]
        (tmp_path / f"{at}.usdc").write_bytes(crate.with_names(damaged).data)
    check(tried(tmp_path))
