"""Meshes with joint weights that are not posed are told, each with its reason."""

from __future__ import annotations

import pytest

from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.skinning import baking

from ..skinned_text import API, RIGID, WAVE, WEIGHTS, bones, character, instance, placed, skin
from ..usd_text import stage_of

BOUND = bones("rel skel:animationSource = </char/wave>")
SKIN = skin("rel skel:skeleton = </char/bones>")
EMPTY = 'def SkelAnimation "wave"\n{\n}\n'
STRANGER = WAVE.replace('"low", "low/high"', '"high", "low"').replace('"high", "low"', '"x", "y"')
FEW = WEIGHTS.replace("[0, 1, 0, 1, 0, 1, 0, 1]", "[0, 1]").replace("[1, 0, 0.5, 0.5, 0, 1, 0.25, 0.75]", "[1, 0]")


def told(text: str) -> list[tuple[str, str, str]]:
    _, diagnostics = translate(stage_of(text), RenderSettings(time_code=10.0))
    return [(d.code, d.prim_path, d.message) for d in diagnostics if d.code in ("posed", "skinning")]


def root(body: str) -> str:
    return placed("def SkelRoot", "char", body)


CASES = {
    "no SkelRoot": (placed("def Xform", "char", BOUND + WAVE + SKIN), "no SkelRoot"),
    "no SkelRoot but elsewhere": (placed("def Xform", "char", BOUND + WAVE + SKIN) + 'def SkelRoot "r"\n{\n}\n', "no SkelRoot"),
    "no schema": (root(BOUND + WAVE + skin("rel skel:skeleton = </char/bones>", header="")), "SkelBindingAPI is not applied"),
    "no skeleton": (root(BOUND + WAVE + skin()), "no Skeleton is bound"),
    "a skeleton that is not there": (root(BOUND + WAVE + skin("rel skel:skeleton = </nothing>")), "no Skeleton is bound"),
    "an empty animation": (root(BOUND + EMPTY + SKIN), "/char/wave is empty"),
    "an animation of other joints": (root(BOUND + STRANGER + SKIN), "moves none"),
    "an animation that is none": (root(BOUND + 'def Xform "wave"\n{\n}\n' + SKIN), "wave"),
    "an animation that is not there": (root(BOUND + SKIN), "/char/wave does not exist"),
    "weights of other points": (root(BOUND + WAVE + skin("rel skel:skeleton = </char/bones>", FEW)), "rejects its weights"),
    "no SkelRoot, weights from above": (
        placed("def Xform", "skin", RIGID + skin("", "").replace('"skin"', '"below"'), header=API),
        "no SkelRoot",
    ),
    "no schema, in an instance": (
        placed("class Xform", "body", skin(header=""))
        + root(BOUND + WAVE + instance("def Xform", "b", "/body", "rel skel:skeleton = </char/bones>")),
        "SkelBindingAPI is not applied",
    ),
    "no skeleton, in an instance": (
        placed("class Xform", "body", skin()) + root(BOUND + WAVE + instance("def Xform", "b", "/body")),
        "no Skeleton is bound",
    ),
    "no SkelRoot, in an instance": (
        placed("class Xform", "body", BOUND + WAVE + SKIN) + instance("def Xform", "b", "/body"),
        "no SkelRoot",
    ),
}


@pytest.mark.parametrize(("text", "reason"), CASES.values(), ids=CASES.keys())
def test_the_reason_is_told(text: str, reason: str) -> None:
    ((code, path, message),) = told(text)
    assert code == "skinning"
    assert path.endswith("/skin")
    assert reason in message


def test_one_posed_mesh_does_not_stand_for_another() -> None:
    other = placed("def Scope", "more", skin())
    assert [found[:2] for found in told(root(BOUND + WAVE + SKIN + other))] == [
        ("posed", "/char"),
        ("skinning", "/char/more/skin"),
    ]


@pytest.mark.parametrize(
    "text",
    [
        root(BOUND + WAVE + SKIN),
        root(BOUND + WAVE + skin("rel skel:skeleton = </char/bones>", RIGID)),
        root(BOUND + WAVE + placed("def Xform", "x", skin("rel skel:skeleton = </char/bones>", ""), header=API)
             .replace("{\n", "{\n" + RIGID, 1)),
        root(bones() + SKIN),
        root(placed("def SkelRoot", "inner", character())),
    ],
    ids=["skinned", "rigid", "rigid from above", "at rest without an animation", "a root below a root"],
)  # fmt: skip
def test_posed_meshes_are_told_as_such(text: str) -> None:
    assert [found[:2] for found in told(text)] == [("posed", "/char")]


def test_a_skeleton_that_moves_nothing_poses_nothing() -> None:
    assert told(root(BOUND + WAVE)) == []


def test_meshes_in_crowds_are_posed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 1)
    text = placed("class SkelRoot", "c", character() + placed("def Scope", "more", skin()))
    both = text + "".join(instance("def SkelRoot", name, "/c") for name in "ab")
    assert [found[:2] for found in told(both)] == [("posed", "/a"), ("skinning", "/a/more/skin")]


def test_a_crowd_that_cannot_be_posed_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 1)
    monkeypatch.setattr(baking, "_bake", lambda *_: "USD cannot pose it.")
    crowd = placed("class SkelRoot", "c", character()) + "".join(instance("def SkelRoot", name, "/c") for name in "ab")
    assert told(crowd) == [("skinning", "/a", "USD cannot pose it.")]
