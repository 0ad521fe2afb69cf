"""Values that jump while the shutter is open, as it opens and as it closes: paths are USD's at all other times.

They jump from one clip to another, between held samples, at knots of splines, at blocked samples, and between samples that
are too close for single precision. Whatever is moved by them stays in the picture.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from primray.description import CameraMotion, Mesh, MovingInstances, SceneDescription
from primray.description.motion import handed_over, segment_of
from primray.settings import RenderSettings
from primray.usd import translate

from .reference import matrix_at, points_at, world_at

SCENE = """#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
)
def Xform "m" (
    CLIPS
)
{
    TRANSLATE
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Cube "cube"
    {
        double3 xformOp:translate = (1, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def SphereLight "lamp"
    {
    }
    def Xform "native" (
        instanceable = true
        references = </kind>
    )
    {
    }
    def Mesh "sheet"
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        POINTS
    }
    def PointInstancer "many"
    {
        rel prototypes = </kind>
        int[] protoIndices = [0, 0, 0]
        POSITIONS
    }
    def Camera "rider"
    {
        double shutter:open = OPEN
        double shutter:close = CLOSE
        double3 xformOp:translate = (0, 0, 20)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
def Xform "kind"
{
    def Cube "k"
    {
    }
}
def Camera "still"
{
    double shutter:open = OPEN
    double shutter:close = CLOSE
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
ROWS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
NAMES = {"TRANSLATE": "double3 xformOp:translate", "POINTS": "point3f[] points", "POSITIONS": "point3f[] positions"}
Samples = dict[float, tuple[float, float, float] | None]
BEFORE, AFTER = (-2.0, 0.0, 0.0), (0.0, 2.0, 0.0)


def line(start: tuple[float, ...], per_code: float, time: float) -> tuple[float, float, float]:
    return start[0] + per_code * time, start[1], start[2]


def text_of(samples: Samples, key: str) -> str:
    rows = []
    for time, place in samples.items():
        if place is None:
            rows.append(f"{time!r}: None")
        elif key == "TRANSLATE":
            rows.append(f"{time!r}: {place}")
        else:
            rows.append(f"{time!r}: {[tuple(row) for row in (ROWS + place).tolist()]}")
    return f"{NAMES[key]}.timeSamples = {{ {', '.join(rows)} }}"


def composed(folder: Path, opens: float, closes: float, clips: str = "", **values: str) -> Usd.Stage:
    text = SCENE.replace("OPEN", repr(opens)).replace("CLOSE", repr(closes)).replace("CLIPS", clips)
    for key, name in NAMES.items():
        text = text.replace(key, values.get(key, name))
    path = folder / "scene.usda"
    path.write_text(text)
    return Usd.Stage.Open(str(path))


def clip(folder: Path, name: str, start: tuple[float, ...], times: list[float]) -> str:
    samples: Samples = {time: line(start, 1.0, time) for time in times}
    body = "".join(
        f"{text_of(samples, 'TRANSLATE')}\n" if not child else f'over "{child}"\n{{\n{text_of(samples, key)}\n}}\n'
        for child, key in (("", "TRANSLATE"), ("sheet", "POINTS"), ("many", "POSITIONS"))
    )
    (folder / name).write_text(f'#usda 1.0\nover "m"\n{{\n{body}}}\n')
    return f"@./{name}@"


def clips_of(folder: Path, active: str, times: str, assets: list[str], name: str = "default") -> str:
    (folder / "manifest.usda").write_text(
        '#usda 1.0\nover "m"\n{\ndouble3 xformOp:translate\nover "sheet"\n{\npoint3f[] points\n}\n'
        'over "many"\n{\npoint3f[] positions\n}\n}\n'
    )
    return f"""dictionary {name} = {{
    asset[] assetPaths = [{", ".join(assets)}]
    string primPath = "/m"
    asset manifestAssetPath = @./manifest.usda@
    double2[] active = {active}
    double2[] times = {times}
}}"""


def two_clips(folder: Path, jump: float, opens: float, closes: float) -> Usd.Stage:
    """Each from its own beginning on."""
    assets = [clip(folder, name, start, [0.0, 0.5, 9.0]) for name, start in (("a.usda", BEFORE), ("b.usda", AFTER))]
    times = f"[(0, 0), ({jump!r}, {jump!r}), ({jump!r}, 0), ({jump + 9!r}, 9)]"
    found = clips_of(folder, f"[(0, 0), ({jump!r}, 1)]", times, assets)
    return composed(folder, opens, closes, f"clips = {{\n{found}\n}}")


def clips_in_step(folder: Path, jump: float, opens: float, closes: float) -> Usd.Stage:
    """Clips of the stage's own time, with samples at the same times: nothing but which is active says that there is a jump."""
    times = sorted({0.0, 1.0, jump, 2.0, 9.0})
    assets = [clip(folder, name, start, times) for name, start in (("a.usda", BEFORE), ("b.usda", AFTER))]
    found = clips_of(folder, f"[(0, 0), ({jump!r}, 1)]", "[(0, 0), (9, 9)]", assets)
    return composed(folder, opens, closes, f"clips = {{\n{found}\n}}")


def several_sets(folder: Path, jump: float, opens: float, closes: float) -> Usd.Stage:
    """The stronger of which has nothing for these prims."""
    (folder / "none.usda").write_text('#usda 1.0\nover "m"\n{\n}\n')
    assets = [clip(folder, name, start, [0.0, 0.5, 9.0]) for name, start in (("a.usda", BEFORE), ("b.usda", AFTER))]
    times = f"[(0, 0), ({jump!r}, {jump!r}), ({jump!r}, 0), ({jump + 9!r}, 9)]"
    weaker = clips_of(folder, f"[(0, 0), ({jump!r}, 1)]", times, assets, "z")
    stronger = 'dictionary a = {\nasset[] assetPaths = [@./none.usda@]\nstring primPath = "/m"\ndouble2[] active = [(0, 0)]\n}'
    return composed(folder, opens, closes, f'clips = {{\n{stronger}\n{weaker}\n}}\nclipSets = ["a", "z"]')


def held(folder: Path, jump: float, opens: float, closes: float) -> Usd.Stage:
    samples: Samples = {0.0: BEFORE, jump: AFTER, jump + 5: BEFORE}
    stage = composed(folder, opens, closes, **{key: text_of(samples, key) for key in NAMES})
    stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    return stage


def close_samples(folder: Path, jump: float, opens: float, closes: float) -> Usd.Stage:
    just_before = jump - 1e-10
    samples: Samples = {0.0: BEFORE, just_before: line(BEFORE, 1.0, 1.0), jump: AFTER, jump + 2: BEFORE}
    return composed(folder, opens, closes, **{key: text_of(samples, key) for key in NAMES})


def blocked(folder: Path, jump: float, opens: float, closes: float) -> Usd.Stage:
    """A transform alone: of points there is none without values."""
    samples: Samples = {0.0: BEFORE, 0.9: line(BEFORE, 1.0, 1.0), jump: None, jump + 2: BEFORE}
    return composed(folder, opens, closes, TRANSLATE=text_of(samples, "TRANSLATE"))


def splined(folder: Path, jump: float, opens: float, closes: float, knot: str = "1", post: str = "held") -> Usd.Stage:
    text = f"double xformOp:translateX.spline = {{ 0: -2; post {post}, {jump!r}: {knot}; post linear, {jump + 2!r}: 3 }}"
    stage = composed(folder, opens, closes, TRANSLATE=text)
    UsdGeom.Xformable(stage.GetPrimAtPath("/m")).GetXformOpOrderAttr().Set(["xformOp:translateX"])
    return stage


def of_two_values(folder: Path, jump: float, opens: float, closes: float) -> Usd.Stage:
    return splined(folder, jump, opens, closes, "-1 & 2", "linear")


Make = Callable[[Path, float, float, float], Usd.Stage]
WAYS: list[Make] = [two_clips, clips_in_step, several_sets, held, close_samples, blocked, splined, of_two_values]
PLACES = {"opens": (1.0, 0.0, 1.0), "middle": (1.4, 0.0, 1.0), "closes": (2.0, 0.0, 1.0), "rounded": (1.3, 0.1, 0.3)}
FRACTIONS = (0.0, 0.01, 0.2, 0.3, 0.39, 0.41, 0.6, 0.9, 0.99, 0.99999)


def world_of_usd(stage: Usd.Stage, path: str, time: float) -> np.ndarray:
    return np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(stage.GetPrimAtPath(path))).T


def times_of(d: SceneDescription) -> list[np.ndarray]:
    levels = [level for placement in d.placements for level in placement.levels if isinstance(level, MovingInstances)]
    points = [shape.motion for shape in d.shapes if isinstance(shape, Mesh) and shape.motion is not None]
    lights = [light.motion for light in d.lights if light.motion is not None]
    cameras = [d.camera_motion] if d.camera_motion is not None else []
    found = [*(level.times for level in levels), *(motion.times for motion in points), *(motion.times for motion in lights)]
    return [np.asarray(times) for times in (*found, *(motion.times for motion in cameras))]


@pytest.mark.parametrize("camera", ["still", "rider"])
@pytest.mark.parametrize(("jump", "opens", "closes"), PLACES.values(), ids=PLACES)
@pytest.mark.parametrize("make", WAYS, ids=lambda make: make.__name__)
def test_paths_that_jump_are_usds(make: Make, jump: float, opens: float, closes: float, camera: str, tmp_path: Path) -> None:
    stage = make(tmp_path, jump, opens, closes)
    d, diagnostics = translate(stage, RenderSettings(time_code=1.0, camera=f"/{'m/' if camera == 'rider' else ''}{camera}"))
    assert [x.message for x in diagnostics if x.code == "motion"] == []
    for times in times_of(d):
        assert (np.diff(handed_over(times)) > 0).all()
        assert len(times) <= 8, "a jump is no curve: it is not cut into ever smaller parts"
    for fraction in FRACTIONS:
        time = 1.0 + opens + fraction * (closes - opens)
        if abs(time - jump) < 1e-5:
            continue
        world = world_of_usd(stage, "/m", time)
        for path in ("cube", "native/k"):
            (found,) = world_at(d, f"/m/{path}", fraction)
            np.testing.assert_allclose(found, world_of_usd(stage, f"/m/{path}", time), atol=2e-4)
        points = UsdGeom.PointBased(stage.GetPrimAtPath("/m/sheet")).GetPointsAttr().Get(time)
        shape = next((s for s in d.shapes if s.path == "/m/sheet"), None)
        if points is not None:
            assert isinstance(shape, Mesh)
            (sheet,) = world_at(d, "/m/sheet", fraction)
            here = shape.points if shape.motion is None else points_at(shape.motion, fraction)
            placed = np.asarray(here) @ sheet[:3, :3].T + sheet[:3, 3]
            np.testing.assert_allclose(placed, np.array(points) + world[:3, 3], atol=2e-4)
        many = UsdGeom.PointInstancer(stage.GetPrimAtPath("/m/many")).GetPositionsAttr().Get(time)
        if many is not None:
            found_places = [
                matrix[:3, 3] for matrix in world_at(d, "/m/many/kind/k", fraction) or world_at(d, "/kind/k", fraction)
            ]
            expected = np.array(many) + world[:3, 3]
            assert all(np.abs(expected_row - np.array(found_places)).max(axis=1).min() < 2e-4 for expected_row in expected)
        (light,) = d.lights
        of_light = light.world_from_light if light.motion is None else matrix_at(light.motion, fraction)
        np.testing.assert_allclose(of_light, world, atol=2e-4)
        if camera == "rider":
            np.testing.assert_allclose(camera_at(d, fraction), world_of_usd(stage, "/m/rider", time), atol=2e-4)


def camera_at(d: SceneDescription, fraction: float) -> np.ndarray:
    if not isinstance(d.camera_motion, CameraMotion):
        return d.camera.world_from_camera
    k, u = segment_of(d.camera_motion.times, fraction)
    a, b = (d.camera_motion.cameras[n].world_from_camera for n in (k, k + 1))
    return np.asarray(a + u * (b - a))


def test_what_goes_on_is_given_no_more_times(tmp_path: Path) -> None:
    """Clips that go on where the one before ends, and held values that stay: there is no jump."""
    assets = [clip(tmp_path, name, BEFORE, [0.0, 1.0, 1.4, 2.0, 9.0]) for name in ("a.usda", "b.usda")]
    found = clips_of(tmp_path, "[(0, 0), (1.4, 1)]", "[(0, 0), (9, 9)]", assets)
    stage = composed(tmp_path, 0.0, 1.0, f"clips = {{\n{found}\n}}")
    d, _ = translate(stage, RenderSettings(time_code=1.0, camera="/still"))
    assert {len(times) for times in times_of(d)} == {2}


def test_jumps_of_a_skeleton(tmp_path: Path) -> None:
    from ..skinned_text import WAVE, bones, placed, skin

    waving = WAVE.replace("10: [(2, 0, 0)", "1.4: [(2, 0, 0)")
    body = bones("rel skel:animationSource = </char/wave>") + waving + skin("rel skel:skeleton = </char/bones>")
    still = SCENE[SCENE.index('def Camera "still"') :].replace("OPEN", "0").replace("CLOSE", "1")
    layer = Sdf.Layer.CreateAnonymous("scene.usda")
    layer.ImportFromString("#usda 1.0\n" + placed("def SkelRoot", "char", body) + still)
    stage = Usd.Stage.Open(layer)
    stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    d, diagnostics = translate(stage, RenderSettings(time_code=1.0))
    assert "motion" not in {x.code for x in diagnostics}
    (mesh,) = d.shapes
    assert isinstance(mesh, Mesh)
    assert mesh.motion is not None
    assert (np.diff(handed_over(mesh.motion.times)) > 0).all()
    before, after = (translate(stage, RenderSettings(time_code=t, motion_blur=False))[0].shapes[0] for t in (1.3, 1.5))
    assert isinstance(before, Mesh)
    assert isinstance(after, Mesh)
    assert np.abs(np.asarray(before.points) - after.points).max() > 0.5
    for fraction, expected in ((0.0, before), (0.39, before), (0.41, after), (1.0, after)):
        np.testing.assert_allclose(points_at(mesh.motion, fraction), expected.points, atol=1e-5)
