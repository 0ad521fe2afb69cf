"""Contact sheets by RayStages over an executor of this machine in place of a cluster: real workers and files, no Ray."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from tests.service.executor.scenes import BROKEN
from tests.service.farm.test_ray_parts import OneMachine

from primray.cli import ray_sheets, run
from primray.cli.ray_sheets import RaySheet, RemoteEnd
from primray.cli.sheet_renders import Limits
from primray.distributed.executor import PartLost
from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray_service.farm import ray_parts
from primray_service.farm.ray_stages import RayStages

BALL = """#usda 1.0
(
    defaultPrim = "s"
    subLayers = [@./look.usda@]
)
def Sphere "s"
{
    double radius = %s
}
"""
LOOK = '#usda 1.0\nover "s"\n{\n    color3f[] primvars:displayColor = [(%s, 0.2, 0.1)]\n}\n'
SMALL = ["--imageWidth", "48", "--spp", "4"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(ray_parts, "RayExecutor", OneMachine)
    monkeypatch.setattr(ray_sheets, "ray_stages", RayStages)
    found = tmp_path / "library"
    found.mkdir()
    (found / "large.usda").write_text(BALL % 2)
    (found / "small.usda").write_text(BALL % 1)
    (found / "look.usda").write_text(LOOK % 0.8)
    return found


def sheet(folder: Path, *flags: str) -> tuple[int, dict[str, dict[str, Any]]]:
    output = folder.parent / "sheet.html"
    code = run(["sheet", str(folder), "-o", str(output), "--roots-only", *SMALL, *flags])
    return code, {row["stage"]: row for row in json.loads(output.with_suffix(".json").read_text())}


def test_the_bits_of_a_sheet_of_this_machine(folder: Path) -> None:
    code, remote = sheet(folder, "--ray", "auto", "--", "--seed", "7", "--imageWidth", "40")
    assert (code, sorted(remote)) == (0, ["large.usda", "small.usda"])
    page = (folder.parent / "sheet.html").read_text()
    assert page.count("data:image/png;base64,") == 2
    _, local = sheet(folder, "--", "--seed", "7", "--imageWidth", "40")
    for stage, row in remote.items():
        assert (row["exit_code"], row["marks"]) == (0, [])
        assert row["report"]["settings"]["resolution"][0] == local[stage]["report"]["settings"]["resolution"][0] == 40
        assert row["report"]["settings"]["seed"] == 7
        assert row["report"]["pixels_sha256"] == local[stage]["report"]["pixels_sha256"]


def test_what_has_not_changed_is_not_rendered_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flags = ("--ray", "auto", "--keep", str(folder.parent / "kept"))
    sheet(folder, *flags)
    _, before = sheet(folder, *flags)
    assert "2 stages, 0 failed, 0 odd, 2 unchanged" in capsys.readouterr().out
    (folder / "large.usda").write_text(BALL % 3)
    _, after = sheet(folder, *flags)
    assert "2 stages, 0 failed, 0 odd, 1 unchanged" in capsys.readouterr().out
    assert before["small.usda"] == after["small.usda"]
    (folder / "look.usda").write_text(LOOK % 0.1)
    sheet(folder, *flags)
    assert "2 stages, 0 failed, 0 odd, 0 unchanged" in capsys.readouterr().out


def test_a_stage_that_fails_is_a_row(folder: Path) -> None:
    (folder / "broken.usda").write_text(BROKEN)
    code, rows = sheet(folder, "--ray", "auto")
    assert code == 1
    assert rows["broken.usda"]["marks"] == ["refused"]
    assert rows["broken.usda"]["message"].startswith("error: ")
    assert rows["small.usda"]["exit_code"] == 0


def test_a_stage_that_takes_too_long(folder: Path) -> None:
    code, rows = sheet(folder, "--ray", "auto", "--timeout", "0.05")
    assert code == 1
    assert {row["exit_code"] for row in rows.values()} == {"time"}


def test_flags_that_do_not_travel(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = str(folder.parent / "sheet.html")
    assert run(["sheet", str(folder), "-o", output, "--ray", "auto", "--", "--exposure", "2"]) == 2
    assert "exposure" in capsys.readouterr().err
    assert run(["sheet", str(folder / "small.usda"), "-o", output, "--ray", "auto"]) == 2
    settings = RenderSettings(session_layer="s.usda")
    with RayStages() as stages, pytest.raises(SettingsError, match="session layer"):
        stages.render(folder / "small.usda", settings, ("p.png",), folder, 60.0, 2**30)


class LostAtFirst:
    """Loses each stage so many times."""

    def __init__(self, times: int) -> None:
        self.left = times

    def render(self, *asked: Any) -> RemoteEnd:
        self.left -= 1
        if self.left >= 0:
            raise PartLost("its node was lost")
        return RemoteEnd(3, 5, "error: refused")


@pytest.mark.parametrize(("times", "code"), [(2, 3), (3, 1)])
def test_a_lost_node_is_tried_again(times: int, code: int, tmp_path: Path) -> None:
    limits = Limits(width=8, spp=1, timeout_s=9, memory_bytes=2**30, threads=None)
    remote: Any = LostAtFirst(times)
    outcome = RaySheet(remote, RenderSettings()).render(tmp_path, tmp_path / "a.usda", limits, tmp_path / "scratch")
    assert outcome.exit_code == code
    assert outcome.marks == (("crash",) if code == 1 else ("refused",))
