"""What a release is made by, held against the project: the workflow, the wheels' Pythons, the conda recipe."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[2]
WORKFLOW = ROOT / ".github/workflows/release.yml"
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RELEASE: dict[str, Any] = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))
RECIPE: dict[str, Any] = yaml.safe_load((ROOT / "deploy/conda/recipe.yaml").read_text(encoding="utf-8"))
JOBS: dict[str, Any] = RELEASE["jobs"]
STEPS = [step for job in JOBS.values() for step in job["steps"]]


def test_the_workflow_is_one() -> None:
    """By GitHub's own schema, which check-jsonschema brings."""
    command = Path(sys.executable).with_name("check-jsonschema")
    if not command.exists():
        pytest.skip("no check-jsonschema: requirements-site.lock has it")
    subprocess.run([command, "--builtin-schema", "vendor.github-workflows", WORKFLOW], check=True)


def test_nothing_is_published_but_by_a_tag_that_passed() -> None:
    for name, job in JOBS.items():
        writes = {right for right, level in job.get("permissions", {}).items() if level == "write"}
        if writes:
            assert job["if"] == "startsWith(github.ref, 'refs/tags/v')", name
            assert "check" in job["needs"], name
    assert RELEASE["permissions"] == {"contents": "read"}
    assert set(JOBS["publish"]["needs"]) == {"wheels", "source", "check"}
    assert "secrets." not in WORKFLOW.read_text(encoding="utf-8").replace("github.token", "")


def test_actions_have_versions_and_commands_are_there() -> None:
    used = [step["uses"] for step in STEPS if "uses" in step]
    assert used
    assert [name for name in used if not re.fullmatch(r"[\w./-]+@(v\d+|release/v\d+)", name)] == []
    for step in STEPS:
        for command in re.findall(r"(?<![\w/])\.ci/[\w-]+", step.get("run", "")):
            assert (ROOT / command).stat().st_mode & 0o111, command


def test_there_is_a_wheel_for_every_python_that_the_makefile_takes() -> None:
    low, high = re.search(r"\(3, (\d+)\) <= .* <= \(3, (\d+)\)", (ROOT / "Makefile").read_text(encoding="utf-8")).groups()  # type: ignore[union-attr]
    wanted = [f"cp3{minor}" for minor in range(int(low), int(high) + 1)]
    assert JOBS["wheels"]["strategy"]["matrix"]["python"] == wanted
    if shutil.which("bash"):
        built = PROJECT["tool"]["cibuildwheel"]["build"]
        told = subprocess.run(["bash", "-c", f"echo {built}"], capture_output=True, text=True, check=True).stdout.split()
        assert told == [f"{python}-manylinux_x86_64" for python in wanted]
    assert PROJECT["project"]["requires-python"] == f">=3.{low}"


def test_tools_of_the_workflow_are_those_of_the_lock() -> None:
    lock = (ROOT / "requirements-site.lock").read_text(encoding="utf-8")
    for name, version in re.findall(r"(auditwheel)==(\S+)", WORKFLOW.read_text(encoding="utf-8")):
        assert f"{name}=={version}" in lock


def test_the_conda_recipe_is_of_this_version() -> None:
    from primray import __version__

    assert RECIPE["context"]["version"] == __version__
    needs = dict(re.findall(r"^([\w-]+)(.*)", "\n".join(PROJECT["project"]["dependencies"]), re.MULTILINE))
    assert needs["embreex"] == f"=={RECIPE['context']['embreex']}"
    listed = {each.split()[0]: "".join(each.split()[1:]) for each in RECIPE["requirements"]["run"]}
    own = {"usd-core": "openusd", "OpenImageIO": "py-openimageio", "opencolorio": "py-opencolorio", "MaterialX": "materialx"}
    for name, version in needs.items():
        if name != "embreex":
            assert listed[own.get(name, name)] == version, name


def test_the_conda_recipe_can_be_read() -> None:
    rattler = pytest.importorskip("rattler_build", reason="no py-rattler-build")
    assert rattler.Stage0Recipe.from_file(str(ROOT / "deploy/conda/recipe.yaml"))
