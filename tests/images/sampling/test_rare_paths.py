"""An error that few bright samples rule names the paths that they took: light, prims, light path expression, and its weight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray import core
from primray.arrays import Doubles
from primray.report import rare_paths, vague_error
from primray.report.picture_checks import weighed_errors

CAUSTIC = "C<.D>+<.S>+L"
SIZE = (48, 32)


def room(light: str = "0.15", ball: str = "glass") -> str:
    """A ball over a floor, under a small light: a caustic of glass, or of a mirror."""
    inputs = {
        "glass": "float inputs:opacity = 0\nfloat inputs:roughness = 0\nfloat inputs:ior = 1.5",
        "mirror": "float inputs:metallic = 1\nfloat inputs:roughness = 0",
    }[ball]
    return f"""#usda 1.0
(
    upAxis = "Y"
)
def Camera "cam"
{{
    float2 clippingRange = (0.1, 100)
    float focalLength = 30
    double3 xformOp:translate = (0, 2.5, 7)
    float3 xformOp:rotateXYZ = (-15, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}}
def SphereLight "key"
{{
    float inputs:radius = {light}
    float inputs:intensity = 3000
    double3 xformOp:translate = (1.5, 5, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def SphereLight "fill"
{{
    float inputs:radius = 1
    float inputs:intensity = 0.2
    double3 xformOp:translate = (-4, 5, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Mesh "floor"
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-6, 0, -6), (-6, 0, 6), (6, 0, 6), (6, 0, -6)]
    color3f[] primvars:displayColor = [(0.6, 0.6, 0.6)]
}}
def Sphere "ball" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    double radius = 1
    double3 xformOp:translate = (0, 1.2, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </m>
}}
def Material "m"
{{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 1, 1)
        {inputs}
        token outputs:surface
    }}
}}
"""


@pytest.fixture(autouse=True)
def caustics_by_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    """Photons would find these caustics."""
    monkeypatch.setattr("primray.core.scene.CoreScene.caustics", lambda *_: None)


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> list[Doubles]:
    """What each pixel adds to the error, of the renders that say what rules it."""
    found, weigh = [], core.Film.error_parts

    def noting(*of: Any) -> Doubles:
        found.append(weigh(*of))
        return found[-1]

    monkeypatch.setattr(core.Film, "error_parts", noting)
    return found


def rendered(folder: Path, text: str, **asked: Any) -> primray.Image:
    (folder / "room.usda").write_text(text)
    return primray.render(folder / "room.usda", resolution=SIZE, progress=False, **asked)


@pytest.mark.parametrize(("ball", "depth", "does"), [("glass", 3, "bends"), ("mirror", 2, "mirrors")])
def test_a_caustic_is_named(tmp_path: Path, ball: str, depth: int, does: str) -> None:
    image = rendered(tmp_path, room(ball=ball), spp=64, max_depth=depth)
    found = image.report["error_ruled_by"]
    first = found["paths"][0]
    assert (first["path"], first["light"], first["prims"]) == (CAUSTIC, "/key", ["/floor", "/ball"])
    assert first["share"] > 0.5
    assert f"light of /key that /ball {does}, on /floor" in found["message"]
    assert f"--aov '{CAUSTIC}'" in found["message"]


def test_a_light_that_is_seen_is_no_caustic(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vague_error, "VAGUE_FACTOR", 1.0)
    stage = Path(__file__).parents[3] / "scenes/analytic/cse168_project1.usda"
    found = primray.render(stage, resolution=(16, 12), spp=16, progress=False).report["error_ruled_by"]
    assert (found["paths"][0]["path"], found["paths"][0]["prims"]) == ("CL", [])
    assert f"{found['paths'][0]['light']}, seen as it is" in found["message"]
    assert "more samples (--spp) smooth it" in found["message"]


def test_pixels_are_weighed_as_the_estimate_weighs_them(tmp_path: Path, parts: list[Doubles]) -> None:
    """A pixel's own value, made by a rare bright sample, would hide its error: nine pixels would have half, not one."""
    image = rendered(tmp_path, room(), spp=16, max_depth=3)
    found = image.report["error_ruled_by"]
    (part,) = parts
    assert part.sum() / part.size / 3 == pytest.approx(image.report["error"]["relmse"]["estimate"], rel=1e-4)
    x, y = found["pixel"]
    assert part[y, x] == part.max()
    assert found["pixels"] == 1
    assert image.errors is not None
    own = weighed_errors(image.pixels, image.errors)
    assert own.max() < 0.2 * own.sum()


def test_what_an_error_takes_without_them_is_what_a_picture_without_them_has(tmp_path: Path, parts: list[Doubles]) -> None:
    rest = "C<.D>+L"
    image = rendered(tmp_path, room(), spp=64, max_depth=3, aovs=(CAUSTIC, rest), aov_errors=True)
    found = image.report["error_ruled_by"]
    assert found["paths"][0]["path"] == CAUSTIC
    errors_of_rest = image.aovs[rest].errors
    assert image.errors is not None
    assert errors_of_rest is not None
    (part,) = parts
    ratio = (errors_of_rest.astype(np.float64) ** 2).sum(axis=2) / (image.errors.astype(np.float64) ** 2).sum(axis=2).clip(
        1e-30
    )
    without = (part * ratio).sum() / part.sum()
    assert without < 0.2
    assert found["error_without"] == pytest.approx(without, abs=0.1)
    told, error = found["to_target"], image.report["error"]["relmse"]
    assert told["relmse"] == 1e-4
    assert told["times"] == {"estimate": error["estimate"] / 1e-4, "ci95": [end / 1e-4 for end in error["ci95"]]}
    assert told["times_without"] == pytest.approx(error["estimate"] * found["error_without"] / 1e-4)


def test_samples_are_those_of_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With splits, several light samples, tiles of different counts and a range of samples."""
    logged: list[Any] = []
    log = rare_paths._Pixel.log.__func__  # type: ignore[attr-defined]

    def noting(cls: type, *of: Any) -> Any:
        logged.append(log(cls, *of))
        return logged[-1]

    monkeypatch.setattr(vague_error, "VAGUE_FACTOR", 1.0)
    monkeypatch.setattr(rare_paths._Pixel, "log", classmethod(noting))
    for asked in ({"target_error": 0.05, "seed": 3}, {"sample_range": (32, 48)}, {"spp": 8, "time_limit_s": 100.0}):
        logged.clear()
        rendered(tmp_path, room(light="0.5"), **asked)
        assert logged
        assert all(pixel is not None for pixel in logged)
        assert all(0 <= pixel.without([]) <= 1 for pixel in logged)
        assert {pixel.without([]) for pixel in logged} == {1.0}


def test_samples_that_are_not_the_picture_say_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = core.log_pixel
    monkeypatch.setattr(core, "log_pixel", lambda scene, x, y, spans, *rest: log(scene, (x + 1) % SIZE[0], y, spans, *rest))
    found = rendered(tmp_path, room(), spp=64).report["error_ruled_by"]
    assert "paths" not in found
    assert "primray doctor" in found["message"]


def test_pixels_are_drawn_by_their_part_of_the_error() -> None:
    part = np.zeros((4, 4))
    part[1, 2], part[3, 3] = 0.75, 0.25

    class Film:
        samples = 16 * rare_paths.MOST_SAMPLES // 8

    class Sampled:
        film = Film()

    drawn = list(rare_paths._drawn(Sampled(), part))  # type: ignore[arg-type]
    assert sorted(drawn) == 6 * [(2, 1)] + 2 * [(3, 3)]
    assert len(set(drawn[:6])) == 2  # not the worst first


def test_long_paths_take_bounded_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Events of a path in a medium are thousands: they are gone through once, and few pixels are enough."""
    monkeypatch.setattr(vague_error, "VAGUE_FACTOR", 1.0)
    monkeypatch.setattr(rare_paths, "MOST_EVENTS", 300)
    logged: list[int] = []
    log = core.log_pixel

    def counting(*of: Any) -> Any:
        events = log(*of)
        logged.append(len(events))
        return events

    monkeypatch.setattr(core, "log_pixel", counting)
    rendered(tmp_path, room(), spp=16)
    assert sum(logged[:-1]) <= 300 < sum(logged)
