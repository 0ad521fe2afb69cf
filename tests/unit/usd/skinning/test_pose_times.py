"""What skeletons pose over the shutter, against UsdSkel's own queries at many times: within the error that is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdSkel

from primray.description import Mesh, MovingInstances, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.skinning import baking

from ..motion.reference import points_at, world_at
from ..skinned_text import API, RIGID, WEIGHTS, bones, instance, points_of_usd, skin
from ..usd_text import stage_of

FRAME = 5.0
CAMERA = """def Camera "cam"
{
    double shutter:open = OPEN
    double shutter:close = CLOSE
    double3 xformOp:translate = (0, 0, 12)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
RESOLUTION = (640, 360)
REST = "[(1, 0, 0, 0), (1, 0, 0, 0)]"
HALF = "[(0.7071068, 0, 0, 0.7071068), (0, 0, 1, 0)]"
TURNING = f"quatf[] rotations.timeSamples = {{ 4: {REST}, 6: {HALF} }}"
STILL = f"quatf[] rotations = {REST}"
SLIDING = (
    "float3[] translations.timeSamples = { 3: [(0, 0, 0), (0, 0, 0)], 5.2: [(1, 0, 0), (0, 1, 0)], 7: [(0, 2, 0), (0, 1, 0)] }"
)
PLACED = "float3[] translations = [(0, 0, 0), (0, 0.5, 0)]"
BLENDS = """uniform token[] skel:blendShapes = ["bulge"]
rel skel:blendShapeTargets = <bulge>
def BlendShape "bulge"
{
    uniform vector3f[] offsets = [(0, 0, 1), (0, 0, 2), (0, 1, 0), (1, 0, 0)]
    INNER
}
"""
INNER = """uniform vector3f[] inbetweens:half = [(2, 0, 0), (0, 0, 0), (0, -1, 0), (0, 0, 1)] (
    weight = 0.4
)"""
SWELLING = (
    'uniform token[] blendShapes = ["bulge"]\nfloat[] blendShapeWeights.timeSamples = { 4: [0.37], 5.25: [0.43], 8: [0.1] }'
)


OUTER = np.array([(0, 0, 1), (0, 0, 2), (0, 1, 0), (1, 0, 0)], float)
BETWEEN = np.array([(2, 0, 0), (0, 0, 0), (0, -1, 0), (0, 0, 1)], float)


def bulged(weights: np.ndarray, with_inner: bool) -> np.ndarray:
    """(4, 3) linear from one shape to the next in weight, and beyond (UsdSkel's schema on in-betweens)."""
    (w,) = weights
    if not with_inner:
        return np.asarray(w * OUTER)
    return np.asarray(w / 0.4 * BETWEEN if w < 0.4 else BETWEEN + (w - 0.4) / 0.6 * (OUTER - BETWEEN))


def camera(opens: float = -0.5, closes: float = 0.5) -> str:
    return CAMERA.replace("OPEN", str(opens)).replace("CLOSE", str(closes))


def animation(*lines: str) -> str:
    body = "\n".join(lines)
    joints = 'uniform token[] joints = ["low", "low/high"]'
    return f'def SkelAnimation "wave"\n{{\n{joints}\nhalf3[] scales = [(1, 1, 1), (1, 1, 1)]\n{body}\n}}\n'


def spun(name: str, kind: str, body: str, header: str = "") -> str:
    op = "float xformOp:rotateZ.timeSamples = { 4: 0, 6: 200 }"
    return f'def {kind} "{name}" ({header})\n{{\n{op}\nuniform token[] xformOpOrder = ["xformOp:rotateZ"]\n{body}\n}}\n'


def character(*lines: str, mesh: str = "", weights: str | None = None) -> str:
    body = skin(f"rel skel:skeleton = <../bones>\n{mesh}", **({} if weights is None else {"weights": weights}))
    return f'def SkelRoot "c"\n{{\n{bones("rel skel:animationSource = <../wave>")}{animation(*lines)}{body}}}\n'


CASES = {
    "joints that turn": character(TURNING, PLACED),
    "joints that slide": character(STILL, SLIDING),
    "both": character(TURNING, SLIDING),
    "what one joint moves": character(TURNING, SLIDING, weights=RIGID),
    "blend shapes": character(STILL, PLACED, SWELLING, mesh=BLENDS),
    "with in-between ones": character(STILL, PLACED, SWELLING, mesh=BLENDS.replace("INNER", INNER)),
    "blend shapes on joints that turn": character(TURNING, PLACED, SWELLING, mesh=BLENDS.replace("INNER", INNER)),
    "a root that turns": spun("top", "Xform", character(TURNING, PLACED)),
    "a scope in the root that turns": 'def SkelRoot "c"\n{\n'
    + bones("rel skel:animationSource = </c/wave>")
    + animation(STILL, PLACED)
    + spun("scope", "Xform", skin("rel skel:skeleton = </c/bones>"))
    + "}\n",
    "a skeleton that turns": 'def SkelRoot "c"\n{\n'
    + spun("s", "Xform", bones("rel skel:animationSource = </c/wave>"))
    + animation(STILL, PLACED)
    + skin("rel skel:skeleton = </c/s/bones>")
    + "}\n",
}
CASES["a skeleton that turns what one joint moves"] = CASES["a skeleton that turns"].replace(WEIGHTS, RIGID)
CASES = {name: text.replace("INNER", "") for name, text in CASES.items()}


def translated(text: str, of_camera: str = "", **settings: Any) -> tuple[SceneDescription, Usd.Stage, list[str]]:
    stage = stage_of((of_camera or camera()) + text)
    chosen: dict[str, Any] = {"time_code": FRAME, "resolution": RESOLUTION, "camera": "/cam", **settings}
    d, diagnostics = translate(stage, RenderSettings(**chosen))
    return d, stage, [x.message for x in diagnostics if x.code == "motion"]


def points_then(d: SceneDescription, fraction: float) -> np.ndarray:
    """(N, 3) in the world, of all meshes at a fraction of the span."""
    found = []
    for shape in d.shapes:
        assert isinstance(shape, Mesh)
        points = shape.points if shape.motion is None else points_at(shape.motion, fraction)
        found += [points @ m[:3, :3].T + m[:3, 3] for m in world_at(d, shape.path, fraction)]
    return np.concatenate(found)


def pixels_off(d: SceneDescription, stage: Usd.Stage, base: float = FRAME, blur_scale: float = 1.0) -> float:
    with_inner = "inbetweens" in stage.GetRootLayer().ExportToString()
    assert d.exposure is not None
    first, last = d.exposure.span
    worst = 0.0
    for fraction in np.linspace(0, 1, 61):
        time = base + blur_scale * (first + fraction * (last - first))
        true = points_of_usd(stage, time, lambda weights: bulged(weights, with_inner))
        off = d.camera.project(points_then(d, float(fraction)), RESOLUTION) - d.camera.project(true, RESOLUTION)
        worst = max(worst, float(np.linalg.norm(off, axis=1).max()))
    return worst


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("error", [0.5, 0.05])
def test_poses_follow_usd_while_the_shutter_is_open(case: str, error: float) -> None:
    d, stage, told = translated(CASES[case], camera(-0.25, 0.25), motion_error=error)
    assert not told
    assert pixels_off(d, stage) < error + 2e-3


def test_a_coarser_error_asks_for_fewer_poses() -> None:
    counts = []
    for error in (1.0, 0.1, 0.01):
        (shape,) = translated(CASES["joints that turn"], motion_error=error)[0].shapes
        assert isinstance(shape, Mesh)
        assert shape.motion is not None
        counts.append(len(shape.motion.times))
    assert counts[0] < counts[1] < counts[2] <= 65


def test_what_is_too_fast_is_told() -> None:
    d, _, told = translated(CASES["joints that turn"], motion_error=1e-6)
    (shape,) = d.shapes
    assert isinstance(shape, Mesh)
    assert shape.motion is not None
    assert len(shape.motion.times) == 65
    assert "64 segments of motion" in told[0]


@pytest.mark.parametrize("case", ["joints that slide", "blend shapes"])
def test_a_still_shows_the_instant(case: str) -> None:
    d, stage, _ = translated(CASES[case], camera(0.4, 0.4))
    assert d.exposure is None
    np.testing.assert_allclose(points_then(d, 0.0), points_of_usd(stage, FRAME + 0.4, lambda w: bulged(w, False)), atol=1e-5)


@pytest.mark.parametrize("scale", [0.0, 0.5, 3.0])
def test_blur_scale_counts_from_the_frame(scale: float) -> None:
    text = CASES["both"].replace(API, 'prepend apiSchemas = ["SkelBindingAPI", "MotionAPI"]')
    text = text.replace("uniform token subdivisionScheme", f"float motion:blurScale = {scale}\nuniform token subdivisionScheme")
    d, stage, _ = translated(text, motion_error=0.1)
    if scale == 0.0:
        assert d.exposure is None
    else:
        assert pixels_off(d, stage, blur_scale=scale) < 0.1 + 2e-3
    still, stage, _ = translated(text, camera(0.25, 0.25))
    np.testing.assert_allclose(points_then(still, 0.0), points_of_usd(stage, FRAME + scale * 0.25), atol=1e-5)


@pytest.mark.parametrize(
    "settings", [{"motion_blur": False}, {"shutter": (0.0, 0.0)}, {"shutter": (0.5, -0.5)}], ids=["off", "instant", "black"]
)
def test_without_an_exposure_the_frame_is_seen(settings: dict[str, Any]) -> None:
    d, stage, _ = translated(CASES["both"], **settings)
    assert d.exposure is None
    np.testing.assert_allclose(points_then(d, 0.0), points_of_usd(stage, FRAME), atol=1e-5)


def test_what_rests_while_the_shutter_is_open_is_baked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    spans = []
    bake = UsdSkel.BakeSkinning

    def noted(root: UsdSkel.Root, interval: Any) -> bool:
        spans.append((interval.GetMin(), interval.GetMax()))
        return bool(bake(root, interval))

    monkeypatch.setattr(UsdSkel, "BakeSkinning", noted)
    text = CASES["both"].replace("4: ", "7: ").replace("3: ", "7: ").replace("5.2: ", "8: ").replace("6: ", "9: ")
    d, _, _ = translated(text)
    assert spans == [(0.0, 0.0)]
    assert d.exposure is None


def test_at_the_default_time_poses_follow_their_first_one() -> None:
    d, stage, _ = translated(CASES["joints that turn"], camera(0, 1), time_code=None)
    assert pixels_off(d, stage, base=4.0) < 0.1 + 2e-3


def test_what_moves_besides_a_skeleton_goes_on_moving() -> None:
    still = character(STILL, PLACED).replace('def Mesh "skin"', spun("spinner", "Cube", "") + 'def Mesh "skin"')
    d, _, _ = translated(still)
    levels = [level for placement in d.placements for level in placement.levels]
    assert [type(level) for level in levels] == [MovingInstances]


@pytest.mark.parametrize("most", [1000, 1], ids=["taken apart", "a crowd"])
def test_instances_are_posed(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", most)
    inside = character(TURNING, PLACED)
    text = f'class "kind" ({API})\n{{\n{inside}}}\n' + "".join(
        "def " + instance("Xform", f"i{k}", "/kind", x=float(k)) for k in range(3)
    )
    d, stage, _ = translated(text, motion_error=0.1)
    worst = 0.0
    for fraction in (0.0, 0.137, 0.5, 0.86, 1.0):
        true, found = points_of_usd(stage, FRAME - 0.5 + fraction), points_then(d, fraction)
        found, true = (rows[np.lexsort(np.round(rows, 1).T)] for rows in (found, true))
        apart = np.linalg.norm(found[:, None] - true, axis=2).min(axis=1)
        worst = max(worst, float(apart.max()))
    assert worst < 0.01
