"""Normals of posed meshes, in every form in which they can be authored, against the joints' inverse transposes written out."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description import Mesh
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.skinning import normals

from ..skinned_text import RIGID, WAVE, bones, placed, skin
from ..usd_text import stage_of

ONE_JOINT = RIGID.replace("[1] (", "[1, 1, 1, 1] (").replace("constant", "vertex")
SCALED = WAVE.replace("half3[] scales = [(1, 1, 1), (1, 1, 1)]", "half3[] scales = [(1, 1, 1), (1, 1, 4)]")
AUTHORED = np.array([(0, 0.6, 0.8), (0, 0, 1), (0.6, 0, 0.8), (0, 0, 1)])
INDICES = "\nint[] primvars:normals:indices = [3, 2, 1, 0]"
TURN = np.array([(0.5, 0, 0.75**0.5), (0, 1, 0), (-(0.75**0.5), 0, 0.5)])  # 60 degrees about y


def primvar(interpolation: str, normals: np.ndarray, indices: str = "", name: str = "primvars:normals") -> str:
    values = ", ".join(map(str, map(tuple, normals.tolist())))
    return f'normal3f[] {name} = [{values}] (\n interpolation = "{interpolation}"\n){indices}'


def normals_of(more: str, weights: str = ONE_JOINT, animation: str = SCALED) -> np.ndarray:
    """(4, 3), by corner."""
    bound = bones("rel skel:animationSource = </char/wave>")
    text = placed("def SkelRoot", "char", bound + animation + skin(f"rel skel:skeleton = </char/bones>\n{more}", weights))
    description, diagnostics = translate(stage_of(text), RenderSettings(time_code=10.0))
    assert ("posed", "/char") in [(d.code, d.prim_path) for d in diagnostics]
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert mesh.normals is not None
    matrix = description.static[0].matrix[:3, :3]
    found = mesh.normals if len(mesh.normals) == 4 else mesh.normals[[0, 1, 2, 5]]
    turned = found @ np.linalg.inv(matrix)
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def expected(normals: np.ndarray, scale: float = 4) -> np.ndarray:
    turned = normals * (1, 1, 1 / scale) @ TURN.T
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


ALL = np.array([0, 1, 2, 3])
ONE = np.array([2, 2, 2, 2])


@pytest.mark.parametrize("name", ["primvars:normals", "normals"])
@pytest.mark.parametrize(
    ("interpolation", "of"),
    [("vertex", ALL), ("varying", ALL), ("faceVarying", ALL), ("uniform", ONE), ("constant", ONE)],
)
def test_normals_turn_with_joints(name: str, interpolation: str, of: np.ndarray) -> None:
    given = AUTHORED if of is ALL else AUTHORED[2:3]
    found = normals_of(primvar(interpolation, given, name=name))
    np.testing.assert_allclose(found, expected(AUTHORED[of]), atol=1e-5)


@pytest.mark.parametrize("interpolation", ["vertex", "faceVarying"])
def test_indexed_normals_turn_with_joints(interpolation: str) -> None:
    found = normals_of(primvar(interpolation, AUTHORED, INDICES))
    np.testing.assert_allclose(found, expected(AUTHORED[::-1]), atol=1e-5)


def test_the_primvar_wins() -> None:
    both = primvar("constant", AUTHORED[2:3]) + "\n" + primvar("vertex", AUTHORED, name="normals")
    np.testing.assert_allclose(normals_of(both), expected(AUTHORED[ONE]), atol=1e-5)


def test_normals_over_time_are_those_of_the_frame() -> None:
    samples = primvar("constant", AUTHORED[2:3]).replace(" = [", ".timeSamples = {0: [(1, 0, 0)], 10: [").replace("] (", "]} (")
    text = samples.split(" (\n")[0] + '\nuniform token primvars:normals:unused = ""'
    assert "timeSamples" in text
    np.testing.assert_allclose(normals_of(text), expected(AUTHORED[ONE]), atol=1e-5)


@pytest.mark.parametrize("kind", ["half3[]", "vector3d[]", "normal3f"])
def test_normals_of_other_types_turn_with_joints(kind: str) -> None:
    text = primvar("constant", AUTHORED[2:3]).replace("normal3f[]", kind)
    found = normals_of(text if "[]" in kind else text.replace("[", "").replace("]", ""))
    np.testing.assert_allclose(found, expected(AUTHORED[ONE]), atol=1e-3)


@pytest.mark.parametrize("weights", ["", ONE_JOINT, RIGID], ids=["no joint", "a joint", "rigid"])
@pytest.mark.parametrize("name", ["primvars:normals", "normals"])
def test_blend_shapes_move_normals_per_point(name: str, weights: str) -> None:
    animation = WAVE.replace(
        "half3[] scales", 'uniform token[] blendShapes = ["up"]\nfloat[] blendShapeWeights = [1]\nhalf3[] scales'
    )
    shape = """uniform token[] skel:blendShapes = ["up"]
rel skel:blendShapeTargets = </char/skin/up>
def BlendShape "up"
{
    uniform vector3f[] offsets = [(0, 0, 2)]
    uniform vector3f[] normalOffsets = [(0.75, 0, 0)]
    uniform int[] pointIndices = [3]
}
"""
    bent = np.array([*AUTHORED[:3], (0.6, 0, 0.8)])
    found = normals_of(primvar("vertex", AUTHORED, name=name) + "\n" + shape, weights, animation)
    np.testing.assert_allclose(found, expected(bent, 1) if weights else bent, atol=1e-5)


def test_a_rigid_mesh_turns_as_a_whole() -> None:
    found = normals_of(primvar("faceVarying", AUTHORED), RIGID, WAVE)
    np.testing.assert_allclose(found, expected(AUTHORED, 1), atol=1e-5)


@pytest.mark.parametrize(
    "more",
    [
        primvar("faceVarying", AUTHORED[:3]),
        primvar("faceVarying", AUTHORED, INDICES.replace("3, 2", "9, 2")),
        primvar("uniform", AUTHORED[:3], name="normals"),
        primvar("uniform", AUTHORED[:1]).replace("(0.0, 0.6, 0.8)", '"up"').replace("normal3f", "string"),
    ],
    ids=["too few", "an index too large", "too many", "text"],
)
def test_normals_that_do_not_fit_are_told_as_without_a_skeleton(more: str) -> None:
    text = placed("def SkelRoot", "char", bones("rel skel:animationSource = </char/wave>") + WAVE)
    bound = text[: text.rindex("}")] + skin(f"rel skel:skeleton = </char/bones>\n{more}") + "}\n"
    codes = [{d.code for d in translate(stage_of(t), RenderSettings())[1]} for t in (bound, skin(more, weights=""))]
    assert codes[0] - {"posed"} == codes[1] - {"skinning"}
    assert any("primvar" in code for code in codes[0])


def test_meshes_without_normals_get_none() -> None:
    stage = stage_of(skin())
    before = stage.GetRootLayer().ExportToString()
    normals.make_bakeable(stage.GetPrimAtPath("/skin"))
    assert stage.GetRootLayer().ExportToString() == before
