"""`primray dataset` makes and verifies, and ends as the page of exit codes says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from primray.cli import run

from ...dataset.room import plain_config, write_room

pytest.importorskip("yaml", reason="no PyYAML")


def test_it_makes_goes_on_and_verifies(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_room(tmp_path)
    config, folder = tmp_path / "set.yaml", tmp_path / "set"
    config.write_text(json.dumps(plain_config(samples=2)))
    for rendered in (2, 0):
        assert run(["dataset", str(config), "-o", str(folder), "--json"]) == 0
        said = json.loads(capfd.readouterr().out)
        assert (said["samples"], said["rendered"]) == (2, rendered)
    assert run(["dataset", "verify", str(folder), "--share", "1"]) == 0
    assert "the same bits in 2 samples" in capfd.readouterr().out
    stage = tmp_path / "room.usda"
    stage.write_text(stage.read_text() + "# other\n")
    assert run(["dataset", "verify", str(folder), "--json"]) == 1
    assert json.loads(capfd.readouterr().out)["difference"]["what"] == "room.usda"
    assert run(["dataset", str(config), "-o", str(folder)]) == 2
    assert "dataset-changed" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["set.yaml"], "dataset-output"),
        (["verify"], "dataset-verify"),
        (["verify", "nothing"], "dataset-incomplete"),
        (["nothing.yaml", "-o", "x"], "dataset-config"),
    ],
)
def test_what_is_missing_is_a_usage_error(
    words: list[str], code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["dataset", *words]) == 2
    assert f"error: {code}" in capfd.readouterr().err
