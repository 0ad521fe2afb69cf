"""Portals over the shutter, against UsdGeomXformCache at many times: by themselves, with their dome, and in instances."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom
from tests.unit.usd.motion.test_matrices import CAMERA, FRAME, prim, translated
from tests.unit.usd.usd_text import stage_of

from primray.description import Doubles, LightType, Portal, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

SPIN = {"double xformOp:rotateY.timeSamples": "{ 0: 0, 10: 500 }"}
SHIFT = {"double3 xformOp:translate.timeSamples": "{ 0: (0, 2, 0), 10: (10, 5, 1) }"}
STAND = {"double3 xformOp:translate": "(0, 2, 0)"}


OTHER = prim("other", SHIFT, "", "Cube")


def dome(ops: dict[str, str], target: str, inside: str = "") -> str:
    return prim("sky", ops, f"    rel portals = <{target}>\n{inside}", "DomeLight")


def portal(ops: dict[str, str]) -> str:
    return prim("window", ops, "    float inputs:width = 3\n", "PortalLight")


SCENES = {
    "by itself": (dome(STAND, "/window") + portal(SHIFT), "/window"),
    "below its dome": (dome(SPIN, "/sky/window", portal(STAND)), "/sky/window"),
    "both": (dome(SPIN, "/sky/window", portal({**SHIFT, "double xformOp:rotateX": "-30"})), "/sky/window"),
    "of a dome that turns": (dome(SPIN, "/set/window") + prim("set", SHIFT, portal(STAND)), "/set/window"),
}


def only(d: SceneDescription) -> Portal:
    (sky,) = [light for light in d.lights if light.type is LightType.DOME]
    (found,) = sky.portals
    return found


def off(found: Portal, stage: Usd.Stage, path: str, d: SceneDescription) -> float:
    """Largest difference of any number of its matrices from USD's, at the times that are given."""
    assert found.motion is not None
    assert d.exposure is not None
    first, last = d.exposure.span

    def true(time: float) -> Doubles:
        return np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(stage.GetPrimAtPath(path))).T

    times = FRAME + first + found.motion.times * (last - first)
    pairs = zip(found.motion.matrices, times.tolist(), strict=True)
    return max(float(np.abs(m - true(t)).max()) for m, t in [*pairs, (found.world_from_portal, FRAME)])


@pytest.mark.parametrize("name", SCENES)
def test_as_usd_has_it(name: str) -> None:
    text, path = SCENES[name]
    d, stage = translated(text + OTHER)
    found = only(d)
    assert off(found, stage, path, d) < 1e-9
    assert found.motion is not None
    assert not np.allclose(found.motion.matrices[0], found.motion.matrices[-1], atol=0.1)
    assert found.width == 3


@pytest.mark.parametrize("outside", [SHIFT, STAND])
@pytest.mark.parametrize("inside", [SHIFT, STAND])
def test_in_instances(outside: dict[str, str], inside: dict[str, str]) -> None:
    """Both in one prototype, whose instance moves, or they in it."""
    held = dome(STAND, "/model/window") + portal(inside)
    model = f'def Xform "model"\n{{\n{held}}}\n'
    text = model.replace("def Xform", "class Xform", 1) + prim("set", outside, "", "Xform").replace(
        'def Xform "set"\n{', 'def Xform "set" (\n    instanceable = true\n    inherits = </model>\n)\n{', 1
    )
    d, stage = translated(text + OTHER)
    found = only(d)
    if inside is STAND and outside is STAND:
        assert found.motion is None
        return
    assert off(found, stage, "/set/window", d) < 1e-9


def test_what_stands_still_has_no_motion() -> None:
    d, _ = translated(dome(STAND, "/window") + portal(STAND) + OTHER)
    assert only(d).motion is None
    d, _ = translated(dome(SPIN, "/sky/window", portal(STAND)), motion_blur=False)
    assert only(d).motion is None


def test_portals_alone_do_not_make_a_scene_move() -> None:
    """They only guide samples: such a stage is as fast as one in which nothing moves."""
    d, _ = translated(dome(STAND, "/window") + portal(SHIFT))
    assert only(d).motion is None
    assert d.exposure is None


def test_a_size_that_changes_is_told() -> None:
    grows = {"float3 xformOp:scale.timeSamples": "{ 0: (1, 1, 1), 10: (3, 3, 3) }"}
    stage = stage_of(CAMERA + dome(STAND, "/window") + portal({**SHIFT, **grows}) + OTHER)
    d, told = translate(stage, RenderSettings(time_code=FRAME, camera="/cam"))
    assert only(d).motion is not None
    assert [(x.code, x.prim_path) for x in told if x.code == "motion"] == [("motion", "/window")]
