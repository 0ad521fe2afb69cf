"""What a release is made by, held against the project: the workflow, the wheels' Pythons, the conda recipe."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

from .go_modules import ACTIONLINT, go

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
WORKFLOW = ROOT / ".github/workflows/release.yml"
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RELEASE: dict[str, Any] = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))
RECIPE: dict[str, Any] = yaml.safe_load((ROOT / "deploy/conda/recipe.yaml").read_text(encoding="utf-8"))
JOBS: dict[str, Any] = RELEASE["jobs"]
STEPS = [step for job in JOBS.values() for step in job["steps"]]


def checked_by(tool: str, *arguments: str | Path) -> str:
    """What it prints; a tool's complaint fails the test."""
    command = Path(sys.executable).with_name(tool)
    if not command.exists():
        pytest.skip(f"no {tool}: requirements-site.lock has it")
    return subprocess.run([command, *arguments], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def test_workflows_are_valid() -> None:
    """GitHub's own schema, which check-jsonschema brings, accepts each workflow."""
    checked_by("check-jsonschema", "--builtin-schema", "vendor.github-workflows", *WORKFLOWS)


def test_nothing_in_a_workflow_is_unsafe() -> None:
    """zizmor finds no excess of rights, kept credentials, movable tags of actions, or expressions of strangers that are run."""
    checked_by("zizmor", "--offline", "--no-progress", *WORKFLOWS)


def test_the_action_is_valid_and_safe(tmp_path: Path) -> None:
    """GitHub's schema and zizmor accept the composite action and the workflows that docs/pull-requests.md shows."""
    checked_by("check-jsonschema", "--builtin-schema", "vendor.github-actions", ROOT / "action.yml")
    checked_by("zizmor", "--offline", "--no-progress", ROOT / "action.yml")
    shown = _shown_workflows(tmp_path)
    assert len(shown) == 2
    checked_by("check-jsonschema", "--builtin-schema", "vendor.github-workflows", *shown)
    checked_by("zizmor", "--offline", "--no-progress", shown[0])
    # The second is of workflow_run, which zizmor warns of whatever it does: it may run nothing of the first.
    checked_by("zizmor", "--offline", "--no-progress", "--config", _accepting_workflow_run(tmp_path), shown[1])
    assert "uses:" not in shown[1].read_text(encoding="utf-8")


def _shown_workflows(folder: Path) -> list[Path]:
    """The YAML of docs/pull-requests.md that names a workflow's file, written below a folder."""
    found = []
    text = (ROOT / "docs/pull-requests.md").read_text(encoding="utf-8")
    for name, body in re.findall(r"```yaml\n# (\.github/workflows/\S+)\n(.*?)```", text, re.DOTALL):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(body.replace("OWNER/primray@COMMIT", f"owner/primray@{'0' * 40}"), encoding="utf-8")
        found.append(path)
    return found


def _accepting_workflow_run(folder: Path) -> Path:
    path = folder / "zizmor.yml"
    path.write_text("rules:\n  dangerous-triggers:\n    ignore: [pictures-comment.yml]\n", encoding="utf-8")
    return path


def test_no_input_of_the_action_is_an_expression_in_a_script() -> None:
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    for step in action["runs"]["steps"]:
        assert step["shell"] == "bash"
        assert "${{" not in step["run"]


@pytest.mark.parametrize(
    ("code", "fails", "ends"),
    [(0, "true", 0), (1, "false", 0), (1, "true", 1), (6, "true", 6), (3, "false", 3), (2, "false", 2)],
)
def test_the_actions_script_ends_as_it_says(code: int, fails: str, ends: int, tmp_path: Path) -> None:
    """Its script runs with a stand-in for primray that prints its arguments; nothing in an input is run by the shell."""
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    script = next(step["run"] for step in action["runs"]["steps"] if step.get("id") == "compare")
    program = tmp_path / "bin/primray"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" > "{tmp_path}/words"\nexit {code}\n')
    program.chmod(0o755)
    given = {"BASE": "", "EVENT_BASE": "abc", "STAGES": "a b/*.usda\n$(touch x)\n", "WIDTH": "64", "SPP": "4", "OUTPUT": "out"}
    environment = {**given, "FAIL_ON_CHANGE": fails, "PATH": f"{program.parent}:/usr/bin:/bin"}
    environment |= {"GITHUB_OUTPUT": str(tmp_path / "output"), "GITHUB_STEP_SUMMARY": str(tmp_path / "summary")}
    done = subprocess.run(["bash", "-e", "-o", "pipefail", "-c", script], cwd=tmp_path, env=environment, check=False)
    assert done.returncode == ends
    words = (tmp_path / "words").read_text().splitlines()
    assert words[-4:] == ["--stage=a b/*.usda", "--stage=$(touch x)", "--", "abc"]
    assert (tmp_path / "output").read_text() == f"exit-code={code}\n"
    assert not (tmp_path / "x").exists()


def test_the_hook_runs_a_command_that_there_is() -> None:
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    assert hook["entry"] == "primray ci --staged"
    assert hook["pass_filenames"] is False
    assert hook["always_run"] is True  # a texture that is deleted alone would not start it


@pytest.mark.long
def test_their_expressions_and_scripts_are_right() -> None:
    """actionlint, which Go compiles first, has no complaint."""
    done = go("run", ACTIONLINT, *map(str, WORKFLOWS))
    assert done.returncode == 0, done.stdout + done.stderr


def test_pull_requests_are_checked() -> None:
    """A pull request is linted and tested on one ISA class within ten minutes; all of .ci/run --nightly is the night's."""
    checks, nightly = (yaml.safe_load((ROOT / f".github/workflows/{name}.yml").read_text()) for name in ("checks", "nightly"))
    assert "pull_request" in checks[True]  # YAML 1.1 reads the key "on" as true
    (job,) = checks["jobs"].values()
    run = [step["run"] for step in job["steps"] if "run" in step]
    assert job["timeout-minutes"] <= 10
    assert "make lint" in run
    assert checks["env"]["PRIMRAY_ISA"] in ("v2", "v3")
    for folder in re.findall(r"tests/[\w/]+", " ".join(run)):
        assert (ROOT / folder).is_dir(), folder
    assert {"tests/unit", "tests/kernels"} <= set(re.findall(r"tests/[\w/]+", " ".join(run)))
    assert any(step.get("run") == ".ci/run --nightly" for job in nightly["jobs"].values() for step in job["steps"])


def test_nothing_is_published_but_by_a_tag_that_passed() -> None:
    for name, job in JOBS.items():
        writes = {right for right, level in job.get("permissions", {}).items() if level == "write"}
        if writes:
            assert job["if"] == "startsWith(github.ref, 'refs/tags/v')", name
            assert "check" in job["needs"], name
    assert RELEASE["permissions"] == {"contents": "read"}
    assert set(JOBS["publish"]["needs"]) == {"wheels", "source", "check"}
    assert "secrets." not in WORKFLOW.read_text(encoding="utf-8").replace("github.token", "")


def test_actions_are_commits_and_commands_are_there() -> None:
    for workflow in WORKFLOWS:
        text = workflow.read_text(encoding="utf-8")
        used = [step["uses"] for job in yaml.safe_load(text)["jobs"].values() for step in job["steps"] if "uses" in step]
        assert used, workflow
        assert [name for name in used if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", name)] == []
        assert re.findall(r"uses: (\S+)  # v\d+\.\d+\.\d+$", text, re.MULTILINE) == used, workflow
    for step in STEPS:
        for command in re.findall(r"(?<![\w/])\.ci/[\w-]+", step.get("run", "")):
            assert (ROOT / command).stat().st_mode & 0o111, command


def test_there_is_a_wheel_for_every_python_that_the_makefile_takes() -> None:
    low, high = re.search(r"\(3, (\d+)\) <= .* <= \(3, (\d+)\)", (ROOT / "Makefile").read_text(encoding="utf-8")).groups()  # type: ignore[union-attr]
    wanted = [f"cp3{minor}" for minor in range(int(low), int(high) + 1)]
    assert JOBS["wheels"]["strategy"]["matrix"]["python"] == wanted
    assert PROJECT["project"]["requires-python"] == f">=3.{low}"
    told = checked_by("cibuildwheel", "--print-build-identifiers", "--platform", "linux")
    assert told.split() == [f"{python}-manylinux_x86_64" for python in wanted]


def test_tools_of_the_workflow_are_those_of_the_lock() -> None:
    lock = (ROOT / "requirements-site.lock").read_text(encoding="utf-8")
    for name, version in re.findall(r"(auditwheel|cibuildwheel)==(\S+)", WORKFLOW.read_text(encoding="utf-8")):
        assert f"{name}=={version}" in lock, name


def test_the_conda_recipe_is_of_this_version() -> None:
    from primray import __version__

    assert RECIPE["context"]["version"] == __version__
    needs = dict(re.findall(r"^([\w-]+)(.*)", "\n".join(PROJECT["project"]["dependencies"]), re.MULTILINE))
    assert needs["embreex"] == f"=={RECIPE['context']['embreex']}"
    listed = {each.split()[0]: "".join(each.split()[1:]) for each in RECIPE["requirements"]["run"]}
    own = {
        "usd-core": "openusd",
        "OpenImageIO": "py-openimageio",
        "opencolorio": "py-opencolorio",
        "MaterialX": "materialx",
        "blosc": "python-blosc",
    }
    for name, version in needs.items():
        if name != "embreex":
            assert listed[own.get(name, name)] == version, name


def test_the_conda_recipe_is_rendered_for_every_python() -> None:
    """As `rattler-build build --render-only` does it: no channel is asked."""
    rattler = pytest.importorskip("rattler_build", reason="no py-rattler-build")
    recipe = rattler.Stage0Recipe.from_file(str(ROOT / "deploy/conda/recipe.yaml"))
    pythons = [python.removeprefix("cp3") for python in JOBS["wheels"]["strategy"]["matrix"]["python"]]
    variants = rattler.VariantConfig({"python": [f"3.{minor}.* *_cp3{minor}" for minor in pythons]})
    platform = rattler.PlatformConfig(target_platform="linux-64", build_platform="linux-64", host_platform="linux-64")
    rendered = [each.recipe.to_dict() for each in recipe.render(variants, rattler.RenderConfig(platform=platform))]
    assert [each["build"]["string"][: len("py311")] for each in rendered] == [f"py3{minor}" for minor in pythons]
    for each in rendered:
        assert each["requirements"]["build"][0] == "gxx_linux-64"
        assert all((ROOT / path).exists() for test in each["tests"] for path in test["files"]["source"])
