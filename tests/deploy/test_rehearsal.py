"""The rehearsal of a release knows all that the workflow does, and refuses what would fail on GitHub."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / ".ci/rehearsal"
JOBS: dict[str, Any] = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8"))["jobs"]
STEPS = [step for job in JOBS.values() for step in job["steps"]]


@pytest.fixture(scope="module")
def program() -> ModuleType:
    spec = importlib.util.spec_from_loader("rehearsal", SourceFileLoader("rehearsal", str(FILE)))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["rehearsal"] = module
    SourceFileLoader("rehearsal", str(FILE)).exec_module(module)
    return module


@pytest.fixture
def rehearsal(program: ModuleType, tmp_path: Path) -> Any:
    return program.Rehearsal(tmp_path / "work", tmp_path / "repository", "9.9.9rc1")


def test_every_step_and_expression_of_the_workflow_is_known(program: ModuleType, rehearsal: Any) -> None:
    rehearsal.context |= {"steps.built.outputs.digest": "sha256:0", "steps.image.outputs.name": "ghcr.io/a/b"}
    for step in STEPS:
        if "uses" in step:
            assert step["uses"].partition("@")[0] in program.ACTIONS
        for value in (*step.get("with", {}).values(), *step.get("env", {}).values()):
            assert "${{" not in rehearsal.expanded(value)


def test_jobs_follow_those_that_they_need(program: ModuleType) -> None:
    order = list(program.ordered(JOBS))
    assert sorted(order) == sorted(JOBS)
    assert all(order.index(needed) < order.index(name) for name, job in JOBS.items() for needed in job.get("needs", ()))
    with pytest.raises(program.Failure, match="need each other"):
        list(program.ordered({"a": {"needs": ["b"]}, "b": {"needs": ["a"]}}))


@pytest.mark.parametrize(
    ("step", "why"),
    [
        ({"uses": "somebody/new-action@0"}, "is not rehearsed"),
        ({"uses": "docker/login-action@0", "with": {"password": "${{ secrets.TOKEN }}"}}, "unknown expression"),
        ({"run": "echo ${{ github.ref }}"}, "an expression in a script"),
        ({"run": "true", "if": "always()"}, "unknown condition"),
        ({"run": "true", "working-directory": "x"}, "unknown keys"),
        ({"run": "false"}, "ended with 1"),
        ({"run": "gh repo delete --yes"}, "ended with 1"),
        ({"uses": "actions/upload-artifact@0", "with": {"name": "a", "path": "dist/*.whl"}}, "no file matches"),
        (
            {"uses": "docker/build-push-action@0", "with": {"tags": "ghcr.io/${{ github.repository }}:v1"}},
            "no image can be named",
        ),
    ],
)
def test_steps_that_are_unknown_or_would_fail(
    step: dict[str, Any], why: str, program: ModuleType, rehearsal: Any, tmp_path: Path
) -> None:
    with pytest.raises(program.Failure, match=why):
        rehearsal.step("job", step, tmp_path)


def test_outputs_of_a_step_are_known_to_later_ones(rehearsal: Any, tmp_path: Path) -> None:
    (step,) = (step for step in STEPS if step.get("id") == "image")
    rehearsal.step("image", step, tmp_path)
    assert (
        rehearsal.expanded("${{ steps.image.outputs.name }}:${{ github.ref_name }}") == "ghcr.io/some-studio/primray:v9.9.9rc1"
    )


@pytest.mark.parametrize(
    ("left_out", "why"),
    [(None, ""), ("--prerelease", "newest"), ("--verify-tag", "gh with"), ("dist/a.whl", "gh would upload")],
)
def test_a_release_on_github_is_checked_as_gh_checks_it(
    left_out: str | None, why: str, program: ModuleType, rehearsal: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    repository = tmp_path / "repository"
    repository.mkdir()
    identity = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    for words in (
        ["init", "--quiet"],
        ["commit", "--quiet", "--allow-empty", "-m", "a"],
        ["tag", "-a", "-m", "a", "v9.9.9rc1"],
    ):
        subprocess.run(["git", *identity, *words], cwd=repository, check=True)
    for name in ("notes.md", "dist/a.whl"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("A rehearsal.\n")
    words = ["dist/a.whl", "--repo", '"$GITHUB_REPOSITORY"', "--verify-tag", "--prerelease", "--notes-file", "notes.md"]
    command = " ".join(["gh release create v9.9.9rc1", *(word for word in words if word != left_out)])
    step: dict[str, Any] = {"run": command, "env": {"GH_TOKEN": "${{ github.token }}"}}
    if left_out is None:
        rehearsal.step("publish", step, tmp_path)
        step["run"] += " --notes-from-tag"  # which gh refuses beside --repo
        why = "--notes-from-tag is not rehearsed"
    with pytest.raises(program.Failure):
        rehearsal.step("publish", step, tmp_path)
    assert why in capfd.readouterr().err
