"""The fixture `primray_image` in pytest runs of its own, with renders of a room made by the real core."""

from __future__ import annotations

import base64
import importlib.metadata
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.compared_scenes import CHANGES, PLAIN, ROOM
from tests.measured import BuiltScene, save

from primray import RenderSettings
from primray.compare import image_check, pytest_plugin
from primray.compare.comparison import compare
from primray.compare.comparison_report import save_difference
from primray.compare.failure_page import write_page
from primray.compare.flip import has_flip
from primray.images.reading import read_measured

pytest_plugins = ["pytester"]
ROOT = Path(__file__).parents[3]
INSTALLED = any(point.value == "primray.compare.pytest_plugin" for point in importlib.metadata.entry_points(group="pytest11"))
PLUGIN = [] if INSTALLED else ["-p", "primray.compare.pytest_plugin"]
TEST = """
def test_shot(primray_image):
    result = primray_image("shot.usda", reference="refs/shot.exr", {arguments})
    assert result.tiles
"""
Run = Callable[..., pytest.RunResult]


def write_room(folder: Path, **changes: Any) -> None:
    (folder / "shot.usda").write_text(ROOM % (PLAIN | changes))


@pytest.fixture(scope="module", autouse=True)
def _everything_is_imported(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A pytest run inside a test forgets the modules that it imports, and USD's cannot be imported twice."""
    folder = tmp_path_factory.mktemp("imports")
    write_room(folder)
    image = BuiltScene(str(folder / "shot.usda"), RenderSettings(resolution=(8, 8))).render(0, 2)
    image = read_measured(save(image, folder / "a.exr"))
    save_difference(compare(image, image), folder / "a.png")
    write_page([], folder / "a.html")


@pytest.fixture
def renders(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Samples of every render that the fixture asks for."""
    made: list[int] = []

    render_file = image_check.render_file

    def counted(stage: Any, settings: RenderSettings, *paths: Path) -> int:
        made.append(settings.most_samples)
        return render_file(stage, settings, *paths)

    monkeypatch.setattr(image_check, "render_file", counted)
    return made


@pytest.fixture
def run(pytester: pytest.Pytester, renders: list[int]) -> Run:
    def run_pytest(*flags: str, arguments: str = "spp=64, resolution=(48, 32)") -> pytest.RunResult:
        pytester.makepyfile(test_shots=TEST.format(arguments=arguments))
        return pytester.runpytest_inprocess(*PLUGIN, "-p", "no:cacheprovider", *flags)

    return run_pytest


def test_a_missing_reference_is_written_and_then_met(pytester: pytest.Pytester, run: Run, renders: list[int]) -> None:
    write_room(pytester.path)
    missing = run()
    missing.assert_outcomes(failed=1)
    missing.stdout.fnmatch_lines(["*the reference *refs/shot.exr does not exist; `pytest --primray-update` renders it"])
    assert renders == []
    updated = run("--primray-update")
    updated.assert_outcomes(passed=1)
    updated.stdout.fnmatch_lines(["primray: wrote the reference *refs/shot.exr"])
    run().assert_outcomes(passed=1)
    assert renders == [64, 64]


def test_a_change_fails_with_its_evidence(pytester: pytest.Pytester, run: Run) -> None:
    write_room(pytester.path)
    run("--primray-update")
    write_room(pytester.path, **CHANGES["small box removed"])
    result = run("--primray-evidence", "kept")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["changed: shot.exr (A) and the picture rendered now (B), 48 x 32", "*tiles: *changed*", "*--primray-update*"]
    )
    assert "Traceback" not in result.stdout.str()
    kept = pytester.path / "kept" / "test_shots.py_test_shot" / "shot"
    assert f"evidence: {kept}" in result.stdout.str()
    assert sorted(path.name for path in kept.iterdir()) == ["difference.png", "reference.exr", "render.exr", "report.json"]
    assert json.loads((kept / "report.json").read_text())["verdict"] == "changed"
    assert (kept / "reference.exr").read_bytes() == (pytester.path / "refs/shot.exr").read_bytes()


def test_a_page_shows_the_failures_of_a_run(pytester: pytest.Pytester, run: Run) -> None:
    write_room(pytester.path)
    run("--primray-update")
    assert "No comparison of pictures failed" in _page(pytester, run)
    write_room(pytester.path, **CHANGES["small box removed"])
    page = _page(pytester, run)
    assert "1 failed comparison of pictures" in page
    assert "test_shots.py::test_shot" in page
    assert re.search(r"<dt>tiles</dt><dd>\d changed", page)
    # It asks for nothing outside of itself, and has each picture whole.
    asked = re.findall(r"""(?:src|href)=["']([^"']*)""", page)
    assert [one for one in asked if not one.startswith(("data:image/png;base64,", "#f"))] == []
    assert "url(" not in page
    shown = [base64.b64decode(text) for text in re.findall(r"data:image/png;base64,([\w+/=]+)", page)]
    pictures = [read_png(png, pytester.path / "shown.png") for png in shown]
    assert [p.shape[:2] for p in pictures] == [(32, 48)] * (6 if has_flip() else 5)
    before, after, again = pictures[:3]
    np.testing.assert_array_equal(before, again)  # under the picture, to be pointed at
    assert (before != after).any()
    assert pictures[4].max() > pictures[4].min()  # where the box was


def _page(pytester: pytest.Pytester, run: Run) -> str:
    run("--primray-html", "out/page.html")
    return (pytester.path / "out" / "page.html").read_text(encoding="utf-8")


def read_png(png: bytes, path: Path) -> np.ndarray[Any, Any]:
    path.write_bytes(png)
    file: Any = oiio.ImageInput.open(str(path))
    spec = file.spec()
    return np.asarray(file.read_image(0, 0, 0, spec.nchannels, oiio.UINT8)).reshape(spec.height, spec.width, -1)


def test_an_unchanged_scene_with_other_noise_passes_and_leaves_nothing(pytester: pytest.Pytester, run: Run) -> None:
    write_room(pytester.path)
    run("--primray-update", arguments="spp=256, resolution=(48, 32)")
    other = "settings=__import__('primray').RenderSettings(seed=5, resolution=(48, 32)), spp=256"
    run("--primray-evidence", "kept", arguments=other).assert_outcomes(passed=1)
    assert not list(pytester.path.glob("kept/*/shot"))


@pytest.mark.parametrize(
    ("more", "outcome", "samples"),
    [
        ("max_spp=4", {"failed": 1}, [4]),
        ("max_spp=4, allow_undecided=True", {"passed": 1}, [4]),
        ("max_spp=4096", {"passed": 1}, None),
    ],
)
def test_undecided_pictures_are_rendered_again_up_to_the_cap(
    pytester: pytest.Pytester, run: Run, renders: list[int], more: str, outcome: dict[str, int], samples: list[int] | None
) -> None:
    write_room(pytester.path)
    common = "settings=__import__('primray').RenderSettings(seed=5, resolution=(48, 32)), reference_spp=1024"
    run("--primray-update", arguments=f"{common}, spp=4")
    renders.clear()
    result = run(arguments=f"{common}, spp=4, {more}")
    result.assert_outcomes(**outcome)
    if samples is not None:
        assert renders == samples
    else:
        assert len(renders) == 2
        assert 4 < renders[1] <= 1024
    if "failed" in outcome:
        result.stdout.fnmatch_lines(["undecided: *", "*more samples a pixel*", "*max_spp=4 would be needed*"])


def test_another_size_is_an_error_in_words(pytester: pytest.Pytester, run: Run) -> None:
    write_room(pytester.path)
    run("--primray-update")
    result = run(arguments="spp=8, resolution=(24, 16)")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["refs/shot.exr: image-size: the pictures differ in size: 48 x 32 and 24 x 16*"])


def test_the_samples_of_a_second_look() -> None:
    """Not asked for where the reference is what is too noisy."""
    from primray.compare.comparison import Needs, Verdict

    class Result:
        verdict = Verdict.UNDECIDED
        needs = Needs(3.0, 16, 16, None, 24)

    result: Any = Result()
    assert image_check._spp_that_decides(result, 8, 1000) == 38
    assert image_check._spp_that_decides(result, 8, 20) == 20
    result.needs = replace(Result.needs, b_alone=None)
    assert image_check._spp_that_decides(result, 8, 1000) == 8


def test_the_plugin_costs_nothing_where_it_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "test_nothing.py").write_text(
        "import sys\n"
        "def test_nothing():\n"
        "    loaded = {'numpy', 'pxr', 'OpenImageIO'} & set(sys.modules)\n"
        "    loaded |= {'primray.compare.comparison', 'primray.compare.image_check'} & set(sys.modules)\n"
        "    assert not loaded\n"
        "    assert 'primray.compare.pytest_plugin' in sys.modules\n"
    )
    command = [sys.executable, "-m", "pytest", "-q", *PLUGIN, "-p", "no:cacheprovider", str(tmp_path)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_the_entry_point_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["entry-points"]["pytest11"] == {"primray": "primray.compare.pytest_plugin"}


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif"])
def test_a_reference_may_be_a_view(suffix: str, pytester: pytest.Pytester, run: Run) -> None:
    write_room(pytester.path)
    pytester.makepyfile(test_views=TEST.format(arguments="spp=64, resolution=(48, 32)").replace("shot.exr", f"shot.{suffix}"))

    def run_views(*flags: str) -> pytest.RunResult:
        return pytester.runpytest_inprocess(*PLUGIN, "-p", "no:cacheprovider", "test_views.py", *flags)

    run_views("--primray-update").assert_outcomes(passed=1)
    run_views().assert_outcomes(passed=1)
    write_room(pytester.path, **CHANGES["small box removed"])
    result = run_views("--primray-evidence", "kept", "--primray-html", "page.html")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"changed: shot.{suffix} (A)*", "*note: the reference is a display picture*"])
    kept = pytester.path / "kept" / "test_views.py_test_shot" / "shot"
    names = ["difference.png", f"reference.{suffix}", "render.exr", f"render.{suffix}", "report.json"]
    assert sorted(path.name for path in kept.iterdir()) == names
    assert (pytester.path / "page.html").read_text().count("<figure>") == 3


def test_noise_does_not_change_a_view(pytester: pytest.Pytester, run: Run) -> None:
    """Another seed: other bits, the same picture."""
    write_room(pytester.path)
    pytester.makepyfile(
        test_views="""
        from primray import RenderSettings
        def test_shot(primray_image, seed=0):
            primray_image("shot.usda", reference="shot.png", spp=64, resolution=(48, 32), settings=RenderSettings(seed=0),
                          tolerance=0.3, allow_undecided=True)
    """
    )
    flags = (*PLUGIN, "-p", "no:cacheprovider", "test_views.py")
    pytester.runpytest_inprocess(*flags, "--primray-update").assert_outcomes(passed=1)
    text = (pytester.path / "test_views.py").read_text().replace("RenderSettings(seed=0)", "RenderSettings(seed=5)")
    (pytester.path / "test_views.py").write_text(text)
    pytester.runpytest_inprocess(*flags).assert_outcomes(passed=1)


def test_every_test_has_a_folder_of_its_own(pytestconfig: pytest.Config) -> None:
    """For every name that a test can have, also where case does not tell files apart."""
    names = ["a.py::t", "a.py::t[a/b]", "a.py::t[a_b]", "a.py::t[a b]", "a.py::t[A_b]", "a/a.py::t", "a_a.py::t", "a.py::T::t"]
    names += [
        "a.py::T_t",
        f"a.py::t[{'x' * 400}]",
        f"a.py::t[{'x' * 401}]",
        "a.py::t[é]",
        "a.py::t[e\u0301]",
        "a.py::t[\ud800]",
    ]
    names += ["a.py::t[..]", "a.py::t[a\\b]", "a.py::t[a:b]"]
    folders = [pytest_plugin._folder_of(name, pytestconfig) for name in names]
    assert len({folder.casefold() for folder in folders}) == len(names)
    assert folders[0] == "a.py_t"  # the plainest keep their names
    assert all(re.fullmatch(r"[\w.-]{1,160}", folder) and folder.isascii() for folder in folders)


def test_references_of_one_name_in_a_test_have_folders_of_their_own(tmp_path: Path) -> None:
    check = image_check.ImageCheck(tmp_path, tmp_path / "kept", None)
    names = ["a/x.exr", "b/x.exr", "a/x.png", "a/x.exr"]
    folders = [check._folder_of(tmp_path / name) for name in names]
    assert len(set(folders)) == 3
    assert folders[0] == folders[3] == tmp_path / "kept" / "x"
