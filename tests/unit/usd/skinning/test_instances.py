"""Skinned meshes, rigs and animations in native instances: where UsdSkelCache has their points through instance proxies."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd

from primray.description import SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.skinning import baking

from ..skinned_text import RIGID, WAVE, bones, character, in_order, instance, placed, points_of, points_of_usd, skin
from ..usd_text import stage_of

Told = list[tuple[str, str]]
BOUND = "rel skel:animationSource = </char/wave>"
TO_BONES = "rel skel:skeleton = </char/bones>"


def translated(text: str) -> tuple[SceneDescription, Told]:
    description, diagnostics = translate(stage_of(text), RenderSettings(time_code=10.0))
    return description, [(d.code, d.prim_path) for d in diagnostics if d.code in ("posed", "skinning")]


def assert_as_usd_poses(text: str) -> Told:
    description, told = translated(text)
    expected = in_order(points_of_usd(stage_of(text), 10.0))
    np.testing.assert_allclose(in_order(points_of(description)), expected, atol=1e-5)
    return told


BODY = placed("class Xform", "body", skin())
RIG = placed("class Xform", "rig", character())
CASES = {
    "a mesh": BODY + placed("def SkelRoot", "char", bones(BOUND) + WAVE + instance("def Xform", "b", "/body", TO_BONES, 3)),
    "two of a mesh": BODY
    + placed(
        "def SkelRoot",
        "char",
        bones(BOUND) + WAVE + "".join(instance("def Xform", f"b{x}", "/body", TO_BONES, x) for x in (1, 4)),
    ),
    "a mesh two levels down": BODY
    + placed("class Xform", "outer", instance("def Xform", "inner", "/body", x=1))
    + placed("def SkelRoot", "char", bones(BOUND) + WAVE + instance("def Xform", "b", "/outer", TO_BONES, 2)),
    "a rigid mesh": placed("class Xform", "body", skin(weights=RIGID))
    + placed("def SkelRoot", "char", bones(BOUND) + WAVE + instance("def Xform", "b", "/body", TO_BONES)),
    "a rig": RIG + placed("def SkelRoot", "char", instance("def Xform", "r", "/rig", x=2)),
    "an animation": placed("class Scope", "library", WAVE)
    + placed(
        "def SkelRoot",
        "char",
        bones("rel skel:animationSource = </char/l/wave>")
        + instance("def Scope", "l", "/library")
        + skin("rel skel:skeleton = </char/bones>"),
    ),
    "an animation elsewhere": placed("class Scope", "library", WAVE)
    + instance("def Scope", "l", "/library")
    + placed("def SkelRoot", "char", bones("rel skel:animationSource = </l/wave>") + skin("rel skel:skeleton = </char/bones>")),
    "a skeleton": placed("class Scope", "skeletons", bones(BOUND))
    + placed(
        "def SkelRoot",
        "char",
        WAVE + instance("def Scope", "s", "/skeletons") + skin("rel skel:skeleton = </char/s/bones>"),
    ),
}


@pytest.mark.parametrize("text", CASES.values(), ids=CASES.keys())
def test_what_stands_in_an_instance_is_posed(text: str) -> None:
    assert assert_as_usd_poses(text) == [("posed", "/char")]


CHARACTER = placed("class SkelRoot", "c", character())


def crowd(number: int, of: str, kind: str = "SkelRoot", body: str = "") -> str:
    return "".join(instance(f"def {kind}", f"c{k}", of, body, 1 + 3 * k) for k in range(number))


@pytest.mark.parametrize(
    "text",
    [
        CHARACTER + crowd(7, "/c"),
        placed("class Xform", "p", placed("def SkelRoot", "char", character(), 0.5)) + crowd(7, "/p", "Xform"),
        CHARACTER + placed("class Xform", "q", instance("def SkelRoot", "in", "/c", x=0.5)) + crowd(7, "/q", "Xform"),
        CHARACTER + placed("class Xform", "q", crowd(7, "/c")) + instance("def Xform", "a", "/q", x=40),
    ],
    ids=["the instance itself", "inside", "two levels", "many in one"],
)
def test_characters_beyond_the_limit_are_posed_as_a_crowd(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 3)
    told = assert_as_usd_poses(text)
    assert [code for code, _ in told] == ["posed"]
    description, _ = translated(text)
    assert len(description.shapes) == 1


def test_a_thousand_and_one_characters() -> None:
    text = CHARACTER + crowd(1001, "/c")
    description, told = translated(text)
    assert told == [("posed", "/c0")]
    assert len(description.shapes) == 1
    one = points_of_usd(stage_of(CHARACTER + crowd(1, "/c")), 10.0)
    np.testing.assert_allclose(points_of(description)[-4:], one + (3000, 0, 0), atol=1e-3)


def test_poses_that_differ_make_crowds_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 3)
    still = WAVE.replace('"wave"', '"still"').replace("(2, 0, 0)", "(0, 0, 5)")
    bound = bones().replace("BOUND", "")
    root = placed("class SkelRoot", "c", bound + skin("rel skel:skeleton = <../bones>"))
    animations = placed("def Scope", "a", WAVE + still)
    text = root + animations
    for name in ("wave", "still"):
        text += placed("def Xform", name, crowd(3, "/c", body=f"rel skel:animationSource = </a/{name}>"))
    told = assert_as_usd_poses(text)
    assert sorted(told) == [("posed", "/still/c0"), ("posed", "/wave/c0")]
    assert len(translated(text)[0].shapes) == 2


def test_a_skeleton_outside_poses_by_where_an_instance_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative to its mesh the skeleton is somewhere else for each: no two are alike."""
    shared = placed("def SkelRoot", "char", bones(BOUND) + WAVE)
    text = placed("class SkelRoot", "c", skin()) + shared + crowd(4, "/c", body="rel skel:skeleton = </char/bones>")
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 4)
    assert_as_usd_poses(text)
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 3)
    assert [code for code, _ in translated(text)[1]] == ["skinning"]


@pytest.mark.parametrize("name", ["two of a mesh", "an animation", "a skeleton"])
def test_what_is_beyond_the_limit_is_told_where_no_two_are_alike(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 0)
    _, told = translated(CASES[name])
    assert told
    assert all(code == "skinning" for code, _ in told)


def test_an_animation_in_one_of_a_crowd_serves_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 3)
    other = bones("rel skel:animationSource = </c2/wave>") + skin("rel skel:skeleton = </char/bones>")
    told = assert_as_usd_poses(CHARACTER + crowd(5, "/c") + placed("def SkelRoot", "char", other))
    assert sorted(told) == [("posed", "/c0"), ("posed", "/c2"), ("posed", "/char")]


def test_the_class_of_a_crowd_takes_no_name_that_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a population mask hides who has it."""
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 1)
    other = placed("def Xform", "posed_0", placed("def Xform", "skin", "", 9))
    whole = stage_of(CHARACTER + crowd(3, "/c") + other)
    stage = Usd.Stage.OpenMasked(whole.GetRootLayer(), Usd.StagePopulationMask(["/c0", "/c1"]))
    description, _ = translate(stage, RenderSettings(time_code=10.0))
    expected = points_of_usd(stage_of(CHARACTER + crowd(2, "/c")), 10.0)
    np.testing.assert_allclose(in_order(points_of(description)), in_order(expected), atol=1e-5)
