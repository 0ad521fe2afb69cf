"""What `make setup`, `make cores` and `make wheel` compile, and how they count it."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from primray import core, errors

SOURCES = Path(__file__).parents[3] / "renderer" / "core"


@pytest.fixture
def build(monkeypatch: pytest.MonkeyPatch) -> Any:
    """renderer/core/build.py on a CPU of class v3."""
    monkeypatch.setattr(core, "runnable_isas", lambda: ["v3", "v2"])
    monkeypatch.setattr(core, "isa", lambda: "v3")
    spec = importlib.util.spec_from_file_location("core_build", SOURCES / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("asked", "isas"), [("own", ["v3"]), ("v3", ["v3"]), ("v2", ["v3", "v2"]), ("all", ["v3", "v2"]), ("v4", ["v3", "v4"])]
)
def test_the_own_class_is_always_among_those_compiled(build: Any, asked: str, isas: list[str]):
    assert build.isas_of(asked) == isas


@pytest.mark.parametrize(
    ("flags", "runnable"),
    [
        ((), []),
        (("v2",), ["v2"]),
        (("v2", "v3"), ["v3", "v2"]),
        (("v2", "v4"), ["v2"]),  # each class asks for all of the older ones
        (("v2", "v3", "v4"), ["v4", "v3", "v2"]),
    ],
)
def test_a_cpu_runs_the_classes_whose_flags_it_has(
    flags: tuple[str, ...], runnable: list[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("primray.core.native._cpu_flags", lambda: set().union(*(core.ISA_FLAGS[name] for name in flags)))
    assert core.runnable_isas() == runnable


def test_a_class_that_was_not_compiled_is_an_error_that_says_what_compiles_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "path", [])
    monkeypatch.delitem(sys.modules, "primray._core_v2", raising=False)
    monkeypatch.setattr(sys, "meta_path", [])
    with pytest.raises(errors.SettingsError, match=r"no v2 core; .*`make cores`"):
        core.load("v2")


def test_ninjas_lines_are_counted_and_no_others(build: Any):
    assert build.counted("  [12/79] Building CXX object film/film.cpp.o\n") == (12, 79)
    for line in ("  *** Building project with Ninja...\n", "film.cpp:12: error: array[12/79] of\n", ""):
        assert build.counted(line) is None


def test_a_log_gets_a_line_every_few_seconds(build: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    now = 0.0
    monkeypatch.setattr(build.time, "monotonic", lambda: now)
    counter = build.Counter("compiling")
    for done in range(1, 41):
        now += 1
        counter.show(done, 40)
    counter.finish()
    shown = capsys.readouterr().out.splitlines()
    assert shown == ["compiling ...", *(f"compiling: {n} of 40 files, {n} s" for n in (10, 20, 30, 40))]


def test_what_pip_said_is_shown_when_it_fails(build: Any, capsys: pytest.CaptureFixture[str], tmp_path: Path):
    build.LOG = tmp_path / "build" / "pip.log"
    assert build.pip("installing", "install", "--no-index", "./there-is-no-such-folder") != 0
    assert "there-is-no-such-folder" in capsys.readouterr().err


@pytest.mark.parametrize(("isas", "made"), [("v2;v3;v4", {"v2", "v3", "v4"}), ("v2", {"v2"}), ("v5", "PRIMRAY_ISAS names v5")])
def test_cmake_makes_the_classes_that_it_is_told(isas: str, made: set[str] | str, tmp_path: Path):
    scripts = Path(sys.executable).parent
    nanobind = subprocess.run([sys.executable, "-m", "nanobind", "--cmake_dir"], capture_output=True, text=True, check=True)
    command = [f"{scripts / 'cmake'}", "-G", "Ninja", "-S", f"{SOURCES}", "-B", f"{tmp_path}", f"-DPRIMRAY_ISAS={isas}"]
    command += [f"-Dnanobind_DIR={nanobind.stdout.strip()}", f"-DPython_EXECUTABLE={sys.executable}"]
    configured = subprocess.run([*command, f"-DCMAKE_MAKE_PROGRAM={scripts / 'ninja'}"], capture_output=True, text=True)
    if isinstance(made, str):
        assert configured.returncode != 0
        assert made in configured.stderr
        return
    assert configured.returncode == 0, configured.stderr
    targets = subprocess.run(
        [scripts / "ninja", "-C", tmp_path, "-t", "targets", "all"], capture_output=True, text=True, check=True
    )
    assert {name for name in ("v2", "v3", "v4") if f"_core_{name}: phony" in targets.stdout} == made
