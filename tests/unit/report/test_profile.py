"""Traces: what they hold, that spans nest as viewers need them, and that a render is the same with and without one."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

import primray
from primray.core import compiled
from primray.errors import SettingsError
from primray.time_spans import span

STAGE = """#usda 1.0
def Sphere "ball" {}
def Mesh "cage" {
    point3f[] points = [(-3, -1, -3), (3, -1, -3), (3, -1, 3), (-3, -1, 3)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "catmullClark"
}
def DomeLight "sky" {}
"""
SMALL: dict[str, Any] = {"resolution": (48, 32), "spp": 16, "threads": 2}


@pytest.fixture
def stage(tmp_path: Path) -> str:
    (tmp_path / "ball.usda").write_text(STAGE)
    return str(tmp_path / "ball.usda")


def events_of(file: Path) -> list[dict[str, Any]]:
    return list(json.loads(file.read_text())["traceEvents"])


def spans_of(file: Path) -> list[dict[str, Any]]:
    return [event for event in events_of(file) if event["ph"] == "X"]


def assert_nested(spans: list[dict[str, Any]]) -> None:
    """Assert that two spans of one row are apart, or one inside the other: viewers drop others."""
    rows = defaultdict(list)
    for each in spans:
        rows[each["tid"]].append((each["ts"], each["ts"] + each["dur"]))
    for row in rows.values():
        open_until: list[float] = []
        for begin, end in sorted(row, key=lambda times: (times[0], -times[1])):
            while open_until and open_until[-1] <= begin:
                open_until.pop()
            assert not open_until or end <= open_until[-1]
            open_until.append(end)


def test_a_trace_has_stages_passes_and_threads(stage: str, tmp_path: Path) -> None:
    with primray.profile(tmp_path / "trace.json"):
        image = primray.render(stage, **SMALL)
    spans = spans_of(tmp_path / "trace.json")
    assert_nested(spans)
    names = {each["name"] for each in spans}
    assert {"open", "translate", "dice", "dice a cage", "build", "finish the scene", "render", "pass", "trace paths"} <= names
    passes = [each for each in spans if each["name"] == "pass"]
    assert sum(each["args"]["samples"] for each in passes) == image.report["samples_per_pixel"][1]
    stages = {each["name"]: each["dur"] / 1e6 for each in spans if each["tid"] == 1}
    assert 0.5 * image.report["stages_s"]["render"] < stages["render"] <= image.report["stages_s"]["render"]
    assert all(
        any(one["ts"] <= each["ts"] and each["ts"] + each["dur"] <= one["ts"] + one["dur"] for one in passes)
        for each in spans
        if each["name"] == "trace paths"
    )
    counters = {event["name"] for event in events_of(tmp_path / "trace.json") if event["ph"] == "C"}
    assert counters == {"memory MB", "samples per pixel", "million rays"}


def test_both_threads_of_a_pass_have_a_row_each(stage: str, tmp_path: Path) -> None:
    with primray.profile(tmp_path / "trace.json"):
        primray.render(stage, **{**SMALL, "resolution": (256, 192)})
    rows = {each["tid"] for each in spans_of(tmp_path / "trace.json") if each["name"] == "trace paths"}
    assert len(rows) == 2
    assert 1 not in rows
    named = {e["tid"]: e["args"]["name"] for e in events_of(tmp_path / "trace.json") if e["name"] == "thread_name"}
    assert named[1] == "main"
    assert all(named[row].startswith("worker ") for row in rows)


def test_a_profile_changes_no_pixel_and_nothing_records_without_one(stage: str, tmp_path: Path) -> None:
    plain = primray.render(stage, **SMALL)
    assert compiled.take_spans() == []
    with primray.profile(tmp_path / "trace.json"):
        traced = primray.render(stage, **SMALL)
    assert traced.report["pixels_sha256"] == plain.report["pixels_sha256"]
    primray.render(stage, **SMALL)
    assert compiled.take_spans() == []


def test_an_error_leaves_the_trace_so_far(tmp_path: Path) -> None:
    with pytest.raises(primray.PrimrayError), primray.profile(tmp_path / "trace.json"):
        primray.render(str(tmp_path / "none.usda"), **SMALL)
    assert {each["name"] for each in spans_of(tmp_path / "trace.json")} >= {"open"}
    with primray.profile(tmp_path / "again.json"):  # the first one has ended
        pass


def test_spans_of_other_threads_share_rows_where_they_follow_each_other(tmp_path: Path) -> None:
    def work(seconds: float) -> None:
        with span("work"):
            time.sleep(seconds)

    with primray.profile(tmp_path / "trace.json"):
        for _ in range(3):
            pair = [threading.Thread(target=work, args=(0.02,)) for _ in range(2)]
            for thread in pair:
                thread.start()
            for thread in pair:
                thread.join()
    spans = spans_of(tmp_path / "trace.json")
    assert_nested(spans)
    assert len(spans) == 6
    assert len({each["tid"] for each in spans}) == 2


def test_a_trace_that_cannot_be_written_is_refused_before_the_render(stage: str, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="does not exist"), primray.profile(tmp_path / "no" / "trace.json"):
        pytest.fail("the block ran")
    outer, inner = primray.profile(tmp_path / "outer.json"), primray.profile(tmp_path / "inner.json")
    with outer, pytest.raises(SettingsError, match="do not nest"), inner:
        pytest.fail("the block ran")


def test_the_command_traces_from_the_start_of_its_process(stage: str, tmp_path: Path) -> None:
    trace, picture = tmp_path / "trace.json", tmp_path / "ball.exr"
    command = [str(Path(sys.executable).with_name("primray")), "render", stage, str(picture), "--spp", "1", "--res", "32", "24"]
    begin = time.monotonic()
    subprocess.run([*command, "--profile", str(trace)], check=True, capture_output=True)
    seconds = time.monotonic() - begin
    spans = spans_of(trace)
    assert_nested(spans)
    first = min(spans, key=lambda each: each["ts"])
    assert first["name"] == "start Python"
    assert first["ts"] == 0
    names = [each["name"] for each in spans if each["tid"] == 1]
    assert [name for name in names if name in ("import", "import USD", "open", "render", "write")] == [
        *("import", "import USD", "open", "render", "write")
    ]
    assert max(each["ts"] + each["dur"] for each in spans) / 1e6 <= seconds + 0.02
    assert picture.exists()
