"""Standard errors of AOVs: right in size, in files, only where asked for; and what comparisons make of AOVs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.aovs.seen import stage_of
from tests.images.aovs.test_aov_files import parts
from tests.images.aovs.test_aovs import BODIES

import primray
from primray import core, usd
from primray.aovs import AOVS
from primray.cli import run
from primray.compare import compare
from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.images.aov import Aov
from primray.render import prepare
from primray.report.report import Costs

FEATURES = Path(__file__).resolve().parents[3] / "scenes" / "features"
LENS = str(FEATURES / "camera-lens" / "scene.usda")
EMISSION = str(FEATURES / "emission" / "scene.usda")
HERE: dict[str, Any] = {"resolution": (48, 32), "progress": False, "seed": 3, "spp": 4}
FILTERED = tuple(name for name, kind in AOVS.items() if kind.filtered)


def _render(stage: Any = LENS, **values: Any) -> primray.Image:
    return primray.render(stage, **{**HERE, **values})


def test_they_are_there_where_asked_for_and_change_nothing(tmp_path: Path) -> None:
    plain, image = _render(aovs=tuple(AOVS)), _render(aovs=tuple(AOVS), aov_errors=True)
    assert image.report["pixels_sha256"] == plain.report["pixels_sha256"]
    assert all(aov.errors is None for aov in plain.aovs.values())
    assert {name for name, aov in image.aovs.items() if aov.errors is not None} == set(FILTERED) == {
        "albedo", "emission", "guide_albedo", "guide_normal", "occlusion", "volume_opacity",
    }  # fmt: skip
    again = primray.read_image(image.save(tmp_path / "a.exr"))
    for name, aov in image.aovs.items():
        np.testing.assert_array_equal(aov.values, plain.aovs[name].values)
        np.testing.assert_array_equal(again.aovs[name].values, aov.values.astype(again.aovs[name].values.dtype))
        assert again.aovs[name].channels == aov.channels
        assert again.aovs[name].samples == aov.samples == (16 if name in FILTERED else None)
        if aov.errors is not None:
            np.testing.assert_array_equal(again.aovs[name].errors, aov.errors)
            assert aov.errors.max() > 0 or name in ("emission", "volume_opacity")
    found = parts(tmp_path / "a.exr")
    assert found["albedo"][0].channelnames[3:] == ("albedo.stderr.R", "albedo.stderr.G", "albedo.stderr.B")
    assert found["depth"][0].channelnames == ("Z",)


@pytest.mark.parametrize(("stage", "name"), [(LENS, "albedo"), (LENS, "guide_normal"), (EMISSION, "emission")])
def test_they_are_as_large_as_they_say(stage: str, name: str) -> None:
    settings = primray.RenderSettings(resolution=(64, 0), aovs=(name,), aov_errors=True)
    opened = usd.open_stage(stage, Diagnostics(), settings.composition)
    scene = prepare(opened, Diagnostics(), settings, Costs(), Diagnostics()).scene
    sets = np.array([core.first_hits(scene, [name], [], settings, replicate=k).planes[name] for k in range(40)], np.float64)
    truth = sets.mean(axis=0)
    variance = ((sets - truth) ** 2).sum(axis=0) / (len(sets) - 1)
    square = (sets[0] - sets[1]) ** 2 / 2  # of one degree of freedom
    image = primray.render(stage, settings, progress=False, spp=2)
    made = image.aovs[name]
    assert made.errors is not None
    scale = scene.exposure_scale if name == "emission" else 1.0
    np.testing.assert_allclose(made.errors.astype(np.float64) ** 2, square * scale**2, rtol=1e-3, atol=1e-12)
    assert variance.mean() > 0
    assert square.mean() == pytest.approx(variance.mean(), rel=0.2)
    # Means of 8 x 8 pixels lie within 1.96 of their errors as often as they should.
    away = []
    for a, b in zip(sets[0::2], sets[1::2], strict=True):
        off, noise = _tiles(a - truth), np.sqrt(_tiles((a - b) ** 2 / 2))
        away += (np.abs(off) / np.maximum(noise, 1e-12))[_tiles(variance) > 0.25 * _tiles(variance).max()].tolist()
    assert 0.88 < (np.array(away) < 1.96).mean() < 0.99


def _tiles(values: np.ndarray) -> np.ndarray:
    height, width = (size // 8 for size in values.shape[:2])
    return values[: height * 8, : width * 8].reshape(height, 8, width, 8, -1).sum(axis=(1, 3))


def test_a_render_variable_asks_for_its_own() -> None:
    text = (
        BODIES
        + """
def RenderSettings "settings"
{
    rel camera = </cam>
    rel products = </product>
}
def RenderProduct "product"
{
    rel orderedVars = [</a>, </b>]
}
def RenderVar "a"
{
    uniform string sourceName = "albedo"
    uniform token dataType = "color3h"
    custom bool primray:errors = true
}
def RenderVar "b"
{
    uniform string sourceName = "albedo"
}
"""
    )
    image = primray.render(stage_of(text), resolution=(24, 18), spp=2, progress=False)
    a, b = image.aovs["a"], image.aovs["b"]
    assert (a.errors is not None, b.errors) == (True, None)
    assert a.error_channels == ("a.stderr.R", "a.stderr.G", "a.stderr.B")


GREY, DARKER = (f"color3f[] primvars:displayColor = [({red}, 0.5, 0.5)]" for red in (0.5, 0.45))


def _painted(color: str, name: str = "a_ball") -> Any:
    return stage_of(BODIES.replace('def Sphere "a_ball"\n{', f'def Sphere "{name}"\n{{\n    {color}'))


def test_comparisons_judge_each_as_what_it_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ("albedo", "depth", "prim", "crypto_object")
    made = {"resolution": (96, 72), "spp": 8, "aovs": asked, "aov_errors": True}
    before = _render(_painted(GREY), **made)
    files = {"before": before.save(tmp_path / "before.exr")}
    for name, stage, more in [
        ("again", _painted(GREY), {"seed": 9}),
        ("painted", _painted(DARKER), {}),
        ("renamed", _painted(GREY, "another"), {}),
    ]:
        files[name] = _render(stage, **made, **more).save(tmp_path / f"{name}.exr")
    found = {
        name: {aov.name: aov.verdict.value for aov in compare(before, file, aovs=["all"], tolerance=0.05).aovs}
        for name, file in files.items()
    }
    unchanged = dict.fromkeys(asked, "unchanged")
    assert found["before"] == found["again"] == unchanged
    assert found["painted"] == {**unchanged, "albedo": "changed"}
    assert found["renamed"] == {**unchanged, "prim": "changed", "crypto_object": "changed"}
    # The picture is the same then: AOVs alone change the verdict, where they are asked for.
    two = str(files["before"]), str(files["renamed"])
    assert run(["compare", *two]) == 0
    assert run(["compare", *two, "--aov", "depth,albedo"]) == 0
    capsys.readouterr()
    assert run(["compare", *two, "--aov", "prim", "--json"]) == 1
    says = json.loads(capsys.readouterr().out)
    assert (says["verdict"], says["aovs"]["prim"]["by"]) == ("changed", "names")
    assert run(["compare", *two, "--aov", "prim"]) == 1
    assert "AOV prim: changed" in capsys.readouterr().out
    with pytest.raises(SettingsError, match="A has no AOV normal; it has albedo"):
        compare(*two, aovs=["normal"])


def test_noise_is_no_change_and_a_change_in_noise_is_one() -> None:
    """AOVs whose samples are the film's, as independent as pictures of two seeds."""
    rng = np.random.default_rng(7)
    picture = _render(spp=16)
    other = _render(spp=16, seed=4)

    def noisy(level: float) -> Aov:
        a, b = (level * (1 + 0.2 * rng.standard_normal((32, 48, 3))) for _ in range(2))
        return Aov((a + b) / 2, ("x.R", "x.G", "x.B"), "x", "", errors=np.abs(a - b) / 2)

    def verdict(a: Aov, b: Aov) -> str:
        one, two = (
            primray.Image(p.pixels, {}, p.metadata, errors=p.errors, aovs={"x": aov}) for p, aov in ((picture, a), (other, b))
        )
        return compare(one, two, aovs=["x"], tolerance=0.1).aovs[0].verdict.value

    assert {verdict(noisy(0.5), noisy(0.5)) for _ in range(20)} == {"unchanged"}
    assert verdict(noisy(0.5), noisy(0.6)) == "changed"


def test_what_is_finite_in_one_alone_differs() -> None:
    one = np.full((32, 48, 1), 3.0, np.float32)
    two = one.copy()
    two[4:9, 4:9] = np.inf
    a, b = (primray.Image(np.ones((32, 48, 4), np.float32), aovs={"depth": Aov(v, ("Z",), "depth", "")}) for v in (one, two))
    assert [aov.verdict.value for aov in compare(a, b, aovs="depth").aovs] == ["changed"]
    assert compare(b, b, aovs="depth").identical
