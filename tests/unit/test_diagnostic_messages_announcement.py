"""The library says once a render what its picture does not show; the command line and the service, which do so, don't twice."""

from __future__ import annotations

import logging
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from primray import RenderSettings, RenderWarning, render_frames
from primray.diagnostic_codes import CODES
from primray.diagnostic_messages import MOST_LINES, Announcer
from primray.diagnostics import Diagnostics
from primray.render import picture_of, prepare, render
from primray.report.report import Costs

if TYPE_CHECKING:
    from tests.unit.conftest import FakePipeline


ERROR = ("texture-unreadable", "/World/sky", "it cannot be read")
WARNING = ("camera-scaled", "/World/cam", "Its scale is removed")


@pytest.fixture
def said() -> Iterator[list[warnings.WarningMessage]]:
    """Every RenderWarning of a test, though the test run as a whole leaves them out."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield caught


def diagnostics(*rows: tuple[str, str, str]) -> Diagnostics:
    found = Diagnostics()
    for code, path, message in rows:
        found.add(code, path, message)
    return found


def test_one_warning_a_render_at_the_callers_line(pipeline: FakePipeline, said: list[Any]) -> None:
    pipeline.diagnostics, pipeline.building = [ERROR, WARNING], [ERROR]
    render("folder/a.usda")
    [warning] = said
    assert warning.category is RenderWarning
    assert warning.filename == __file__
    text = str(warning.message)
    assert text.startswith("a.usda: 1 error, 1 warning\n")
    assert all(part in text for part in (*ERROR, *WARNING))


def test_what_only_informs_is_not_said(pipeline: FakePipeline, said: list[Any], caplog: pytest.LogCaptureFixture) -> None:
    infos = [code for code, about in CODES.items() if about.severity.value == "info"]
    pipeline.diagnostics = [(infos[0], "/a", "so it is")]
    assert len(render("a.usda").report["diagnostics"]) == 1
    assert not said
    assert not caplog.records


def test_each_goes_to_the_logger(pipeline: FakePipeline, caplog: pytest.LogCaptureFixture) -> None:
    pipeline.diagnostics = [ERROR, WARNING]
    render("a.usda")
    found = [(r.name, r.levelno, r.code, r.prim_path) for r in caplog.records]  # type: ignore[attr-defined]
    assert found == [
        ("primray", logging.ERROR, ERROR[0], ERROR[1]),
        ("primray", logging.WARNING, WARNING[0], WARNING[1]),
    ]
    assert ERROR[2] in caplog.records[0].getMessage()


def test_it_is_said_before_sampling(pipeline: FakePipeline) -> None:
    pipeline.diagnostics = [WARNING]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RenderWarning):
            render("a.usda")
    assert "render" not in pipeline.calls


def test_what_sampling_finds_is_said_after_it_alone(pipeline: FakePipeline, said: list[Any]) -> None:
    pipeline.diagnostics, pipeline.invalid_samples = [WARNING], 3
    render("a.usda")
    assert [WARNING[0] in str(w.message) for w in said] == [True, False]
    assert "invalid-samples" in str(said[1].message)


def test_every_frame_is_a_render(pipeline: FakePipeline, said: list[Any]) -> None:
    pipeline.diagnostics = [WARNING]
    list(render_frames("a.usda", [RenderSettings(time_code=t) for t in (1.0, 2.0)]))
    assert [w.filename for w in said] == [__file__, __file__]


def test_many_are_cut_short() -> None:
    many = diagnostics(*[("texture-unreadable", f"/a{k}", f"file {k}") for k in range(5)], *[WARNING])
    codes = [code for code, about in CODES.items() if about.severity.value == "warning"]
    for code in codes[:30]:
        many.add(code, "/a", "so it is")
    with pytest.warns(RenderWarning) as caught:
        Announcer("a.usda").tell(many)
    lines = str(caught[0].message).splitlines()
    assert len(lines) == MOST_LINES + 2
    assert "image.report" in lines[-1]


def test_the_command_line_says_it_once(
    pipeline: FakePipeline, said: list[Any], caplog: Any, tmp_path: Path, capsys: Any
) -> None:
    from primray.cli import run

    pipeline.diagnostics = [ERROR]
    assert run(["render", "a.usda", "-o", str(tmp_path / "a.exr")]) == 0
    assert not said
    assert not caplog.records
    assert capsys.readouterr().err.count(ERROR[2]) == 1


def test_what_the_service_calls_says_nothing(pipeline: FakePipeline, said: list[Any], caplog: Any) -> None:
    """Its worker has `prepare` and `picture_of`, and sends the report."""
    from primray.sampling.sampling import Sampling

    pipeline.diagnostics, costs, found = [ERROR], Costs(), Diagnostics()
    prepared = prepare("a.usda", Diagnostics(), RenderSettings(), costs, found)
    with costs.stage("render"):
        sampling = Sampling.begin(prepared.scene, prepared.settings)
        sampling.run(lambda *now: True)
    assert len(picture_of(prepared, sampling, costs, found).report["diagnostics"]) == 1
    assert not said
    assert not caplog.records


SCRIPT = """
import primray, sys
if len(sys.argv) > 1:
    import logging; logging.basicConfig()
for seed in range(2):
    primray.render("s.usda", resolution=(4, 4), spp=1, seed=seed)
"""


@pytest.mark.parametrize(("arguments", "warned", "logged"), [([], 1, 0), (["log"], 1, 2)])
def test_a_script_hears_it_once_and_a_log_each_time(tmp_path: Path, arguments: list[str], warned: int, logged: int) -> None:
    """By Python's own rule a line warns once with the same text; logging that nobody set up prints nothing."""
    sky = 'def DomeLight "d" {\n asset inputs:texture:file = @no.exr@\n}\n'
    (tmp_path / "s.usda").write_text(f'#usda 1.0\n{sky}def Sphere "s" {{\n}}\n')
    (tmp_path / "s.py").write_text(SCRIPT)
    done = subprocess.run([sys.executable, "s.py", *arguments], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.count("s.py:6: RenderWarning: s.usda: ") == warned, done.stderr
    assert done.stderr.count("ERROR:primray:asset-missing: ") == logged
    assert done.stderr.count("no.exr cannot be found") == warned + logged


def test_a_stage_in_memory_has_no_name() -> None:
    with pytest.warns(RenderWarning, match="^the stage: 1 warning"):
        Announcer(SimpleNamespace()).tell(diagnostics(WARNING))
