"""Assertions of the core name their condition and its place, and cost nothing where they are not checked; PRIMRAY_CORES."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from primray.core.native import module

CORE = Path(__file__).parents[3] / "renderer" / "core"
PROGRAM = """#include "math/lane_checks.hpp"
using namespace primray;
int evaluated = 0;
int main(int argc, char**) {
  PRIMRAY_ASSERT(++evaluated);
  PRIMRAY_ASSERT(are_rows(vint<4>(argc), size_t(2)));
  return evaluated;
}
"""


@pytest.fixture(scope="module", params=[0, 1], ids=["release", "debug"])
def program(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path]:
    compiler = shutil.which(os.environ.get("CXX", "c++"))
    if compiler is None:
        pytest.skip("no C++ compiler")
    folder = tmp_path_factory.mktemp("assert")
    (folder / "program.cpp").write_text(PROGRAM)
    flags = ["-std=c++20", "-march=x86-64-v2", "-Wno-psabi", f"-I{CORE}", f"-DPRIMRAY_DEBUG={request.param}"]
    subprocess.run([compiler, *flags, "program.cpp", "-o", "program"], cwd=folder, check=True)
    return request.param, folder / "program"


def test_a_true_condition_is_evaluated_only_in_a_debug_build(program: tuple[int, Path]) -> None:
    is_debug, file = program
    assert subprocess.run([file], check=False).returncode == is_debug


def test_a_false_condition_ends_a_debug_build_with_its_place(program: tuple[int, Path]) -> None:
    is_debug, file = program
    ran = subprocess.run([file, "out", "of range"], check=False, capture_output=True, text=True)
    said = "program.cpp:6: assertion failed: are_rows(vint<4>(argc), size_t(2))\n" if is_debug else ""
    assert ran.stderr == said
    assert (ran.returncode < 0) == bool(is_debug)


def test_a_module_of_another_folder_is_imported_once(tmp_path: Path) -> None:
    own = Path(str(module().__file__))
    (tmp_path / own.name).symlink_to(own)
    asks = "from primray import core\ncore.module()\nprint(core.load(core.isa()) is core.load(core.isa()))"
    ran = subprocess.run(
        [sys.executable, "-c", asks],
        env=os.environ | {"PRIMRAY_CORES": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout == "True\n"


def test_a_folder_without_the_class_is_an_error(tmp_path: Path) -> None:
    asks = "from primray import core, errors\ntry:\n    core.module()\nexcept errors.SettingsError:\n    print('refused')"
    ran = subprocess.run(
        [sys.executable, "-c", asks],
        env=os.environ | {"PRIMRAY_CORES": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout == "refused\n"
