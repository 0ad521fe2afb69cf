"""Skinned meshes against linear blend skinning written out, at the default time, at samples and between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Usd

from primray.description import Mesh
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.skinning import baking

from ..usd_text import stage_of, translate_text

HEAD = "#usda 1.0\n(\n timeCodesPerSecond = 24\n)\n"
BONES = (
    "[( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) ), ( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (2, 0, 0, 1) )]"
)
ARM = """
def SkelRoot "arm"
{
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Skeleton "bones" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        uniform token[] joints = ["upper", "upper/lower"]
        uniform matrix4d[] bindTransforms = BONES
        uniform matrix4d[] restTransforms = BONES
        rel skel:animationSource = <../wave>
    }
    def SkelAnimation "wave"
    {
        uniform token[] joints = ["upper", "upper/lower"]
        float3[] translations = [(0, 0, 0), (2, 0, 0)]
        quatf[] rotations.timeSamples = {
            1: [(1, 0, 0, 0), (1, 0, 0, 0)],
            3: [(1, 0, 0, 0), (0.70710678, 0, 0, 0.70710678)],
        }
        half3[] scales = [(1, 1, 1), (1, 1, 1)]
    }
    def Mesh "skin" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(1, 0, 0), (4, 0, 0), (2, 1, 0)]
        rel skel:skeleton = <../bones>
        int[] primvars:skel:jointIndices = [0, 1, 0, 1, 0, 1] (
            elementSize = 2
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [1, 0, 0, 1, 0.5, 0.5] (
            elementSize = 2
            interpolation = "vertex"
        )
    }
}
""".replace("BONES", BONES)


def skinned(degrees: float) -> np.ndarray:
    """p' = sum of w (joint * inverse bind) p; only the lower joint turns, about z at (2, 0, 0)."""
    a = math.radians(degrees)
    turn = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    points = np.array([[1, 0, 0], [4, 0, 0], [2, 1, 0]], float)
    lower = (points - (2, 0, 0)) @ turn.T + (2, 0, 0)
    weight = np.array([[0], [1], [0.5]])
    return points * (1 - weight) + lower * weight


@pytest.mark.parametrize(("time", "degrees"), [(None, 0), (1.0, 0), (3.0, 90), (2.0, 45), (9.0, 90)])
def test_joints_move_points(time: float | None, degrees: float) -> None:
    description, diagnostics = translate_text(HEAD + ARM, RenderSettings(time_code=time))
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert mesh.points == pytest.approx(skinned(degrees), abs=1e-5)
    assert description.static[0].matrix[0, 3] == 10
    assert ("posed", "/arm") in diagnostics
    assert not [code for code, _ in diagnostics if code == "skinning"]


def test_at_the_default_time_the_first_sample_poses() -> None:
    turned = ARM.replace("1: [(1, 0, 0, 0), (1, 0, 0, 0)],", "").replace("3: [", "7: [")
    (mesh,) = translate_text(HEAD + turned)[0].shapes
    assert isinstance(mesh, Mesh)
    assert mesh.points == pytest.approx(skinned(90), abs=1e-5)


def test_the_callers_stage_is_left_alone() -> None:
    stage = stage_of(HEAD + ARM)
    before = stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString()
    translate(stage, RenderSettings(time_code=3.0))
    assert (stage.GetRootLayer().ExportToString(), stage.GetSessionLayer().ExportToString()) == before
    assert stage.GetPrimAtPath("/arm").GetTypeName() == "SkelRoot"
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.GetPrimAtPath("/arm/skin").SetActive(False)  # the session's own opinions count for the posed stage too
    assert translate(stage, RenderSettings(time_code=3.0))[0].shapes == ()


def test_blend_shapes_move_points() -> None:
    shape = """
    def BlendShape "up"
    {
        uniform vector3f[] offsets = [(0, 0, 2)]
        uniform int[] pointIndices = [2]
    }
"""
    blended = ARM.replace(
        "float3[] translations",
        'uniform token[] blendShapes = ["up"]\nfloat[] blendShapeWeights = [0.5]\nfloat3[] translations',
    )
    blended = blended.replace(
        "rel skel:skeleton",
        f'{shape}\nuniform token[] skel:blendShapes = ["up"]\nrel skel:blendShapeTargets = <up>\nrel skel:skeleton',
    )
    (mesh,) = translate_text(HEAD + blended, RenderSettings(time_code=3.0))[0].shapes
    assert isinstance(mesh, Mesh)
    assert mesh.points[:, 2] == pytest.approx([0, 0, 1], abs=1e-5)


def test_too_many_instances_with_skeletons_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(baking, "MAX_UNINSTANCED", 0)
    instance = 'def "a" (\n instanceable = true\n references = </c>\n)\n{\n}\n'
    description, diagnostics = translate_text(HEAD + f'class "c"\n{{\n{ARM}}}\n{instance}')
    assert len(description.shapes) == 1
    assert [code for code, _ in diagnostics if code in ("posed", "skinning")] == ["skinning"]


@pytest.mark.parametrize(
    ("whole", "broken"),
    [
        (f"bindTransforms = {BONES}", "bindTransforms = []"),
        (f"restTransforms = {BONES}", "restTransforms = []"),
        ("[0, 1, 0, 1, 0, 1]", "[0, 9, 0, 9, 0, 9]"),
        ("[0, 1, 0, 1, 0, 1]", "[0]"),
        ("<../bones>", "<../nothing>"),
        ("elementSize = 2", "elementSize = -2"),
        ('uniform token[] joints = ["upper", "upper/lower"]', 'uniform token[] joints = ["upper/lower", "upper", "upper"]'),
    ],
)
def test_broken_skeletons_break_nothing_else(whole: str, broken: str) -> None:
    text = ARM.replace(whole, broken)
    assert text != ARM
    description, _ = translate_text(HEAD + text + 'def Sphere "other"\n{\n}\n')
    assert "/other" in [shape.path for shape in description.shapes]


def prototype(name: str, body: str) -> str:
    return f'class Xform "{name}"\n{{\n{body}\n}}\n'


def instance(name: str, of: str) -> str:
    return f'def Xform "{name}" (\n instanceable = true\n inherits = </{of}>\n)\n{{\n}}\n'


@pytest.mark.parametrize(
    "text",
    [
        prototype("p", ARM) + instance("a", "p") + instance("b", "p"),
        prototype("p", ARM) + prototype("q", instance("in", "p")) + instance("a", "q") + instance("b", "q"),
        ARM.replace("def SkelRoot", "class SkelRoot", 1) + (instance("a", "arm") + instance("b", "arm")).replace("Xform ", ""),
    ],
    ids=["inside", "two levels", "the instance itself"],
)
def test_skeletons_in_instances_are_posed(text: str) -> None:
    description, diagnostics = translate_text(HEAD + text, RenderSettings(time_code=3.0))
    assert [code for code, _ in diagnostics].count("posed") == 2
    assert len(description.shapes) == 2
    for mesh in description.shapes:
        assert isinstance(mesh, Mesh)
        np.testing.assert_allclose(mesh.points, skinned(90), atol=1e-5)
