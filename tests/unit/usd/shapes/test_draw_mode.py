"""Draw modes: when they replace a model, and where cards, bars and texture coordinates lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.description import Mesh, SceneDescription, TextureInput
from primray.settings import RenderSettings
from primray.usd.shapes.draw_mode import FACES

from ..usd_text import translate_text

BOX = "float3[] extentsHint = [(-1, -2, -3), (1, 2, 3)]"
# Image right and up of each face as seen from outside; OpenUSD's imaging turns Z- upside down.
RIGHT_UP = {
    "XPos": ((0, 1, 0), (0, 0, 1)),
    "XNeg": ((0, -1, 0), (0, 0, 1)),
    "YPos": ((-1, 0, 0), (0, 0, 1)),
    "YNeg": ((1, 0, 0), (0, 0, 1)),
    "ZPos": ((1, 0, 0), (0, 1, 0)),
    "ZNeg": ((1, 0, 0), (0, -1, 0)),
}
OUT = {"XPos": (1, 0, 0), "XNeg": (-1, 0, 0), "YPos": (0, 1, 0), "YNeg": (0, -1, 0), "ZPos": (0, 0, 1), "ZNeg": (0, 0, -1)}


def model(body: str, kind: str = "component", settings: RenderSettings | None = None) -> tuple[SceneDescription, list[str]]:
    text = f'def Xform "m" (\n kind = "{kind}"\n)\n{{\n{BOX}\n{body}\n def Sphere "s"\n {{\n }}\n}}\n'
    description, diagnostics = translate_text(text, settings)
    return description, [code for code, _ in diagnostics]


def card_mesh(body: str) -> Mesh:
    description, _ = model(body)
    (shape,) = description.shapes
    assert isinstance(shape, Mesh)
    return shape


def normals(mesh: Mesh) -> np.ndarray:
    a, b, c = (mesh.points[mesh.triangles[:, k]].astype(float) for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("kind", "body", "replaced"),
    [
        ("component", 'uniform token model:drawMode = "bounds"', True),
        ("component", 'uniform token model:drawMode = "default"', False),
        ("component", 'uniform token model:drawMode = "inherited"', False),
        ("component", 'uniform token model:drawMode = "bounds"\nuniform bool model:applyDrawMode = false', False),
        ("group", 'uniform token model:drawMode = "bounds"', False),
        ("group", 'uniform token model:drawMode = "bounds"\nuniform bool model:applyDrawMode = true', True),
        ("", 'uniform token model:drawMode = "bounds"\nuniform bool model:applyDrawMode = true', False),
        ("subcomponent", 'uniform token model:drawMode = "bounds"\nuniform bool model:applyDrawMode = true', False),
        ("component", 'uniform token model:drawMode = "sketch"', False),
    ],
)
@pytest.mark.conforms("GeomModelAPI.model:drawMode", "GeomModelAPI.model:applyDrawMode")
def test_when_a_model_is_replaced(kind: str, body: str, replaced: bool) -> None:
    description, codes = model(body, kind)
    assert [shape.path for shape in description.shapes] == ["/m" if replaced else "/m/s"]
    assert ("draw-mode" in codes) == replaced
    assert ("draw-mode-input" in codes) == ("sketch" in body)


@pytest.mark.conforms("GeomModelAPI.model:drawMode")
def test_the_mode_is_inherited_and_applied_at_components_only() -> None:
    text = """
def Xform "world" (
    kind = "group"
)
{
    uniform token model:drawMode = "origin"
    def Sphere "loose"
    {
    }
    def Xform "a" (
        kind = "component"
    )
    {
        def Sphere "s"
        {
        }
    }
    def Xform "b" (
        kind = "component"
    )
    {
        uniform token model:drawMode = "default"
        def Sphere "s"
        {
        }
    }
}
"""
    description, _ = translate_text(text)
    assert [shape.path for shape in description.shapes] == ["/world/loose", "/world/a", "/world/b/s"]


def test_what_is_no_model_is_drawn_itself_below_one() -> None:
    """Neither what it says of itself nor what it inherits counts; opinions of what is no model are not inherited."""
    inner = 'uniform token model:drawMode = "cards"\nuniform bool model:applyDrawMode = true\ndef Sphere "s"\n{\n}\n'
    part = 'def Xform "part" (\n kind = "subcomponent"\n)\n{\n' + inner + "}\n"
    lone = 'def Xform "lone" (\n kind = "component"\n)\n{\ndef Sphere "s"\n{\n}\n}\n'
    text = f'def Xform "w" (\n kind = "group"\n)\n{{\nuniform token model:drawMode = "bounds"\n{part}}}\n'
    text += f'def Xform "plain"\n{{\nuniform token model:drawMode = "bounds"\n{lone}}}\n'
    description, _ = translate_text(text)
    assert [shape.path for shape in description.shapes] == ["/w/part/s", "/plain/lone/s"]


def test_a_prototype_elsewhere_does_not_inherit_the_mode_of_its_instancer() -> None:
    model = f'def Xform "a" (\n kind = "component"\n)\n{{\n{BOX}\n def Sphere "s"\n {{\n }}\n}}\n'
    lines = 'int[] protoIndices = [0]\npoint3f[] positions = [(0, 0, 0)]\nuniform token model:drawMode = "bounds"\n'
    for lib, inside, root in (("", model, "/w/p/a"), (model, "", "/lib/a")):
        instancer = f'def PointInstancer "p" (\n kind = "group"\n)\n{{\nrel prototypes = <{root}>\n{lines}{inside}}}\n'
        text = f'over "lib" (\n kind = "group"\n)\n{{\n{lib}}}\ndef Xform "w" (\n kind = "group"\n)\n{{\n{instancer}}}\n'
        description, _ = translate_text(text)
        assert [shape.path for shape in description.shapes] == ["/lib/a/s" if lib else "/w/p/a"]


def test_native_instances_inherit_the_mode_and_are_replaced() -> None:
    instances = "".join(
        f'def Xform "{name}" (\n instanceable = true\n references = </proto>\n kind = "component"\n)\n{{\n'
        f'double3 xformOp:translate = ({k}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
        for k, name in enumerate("ab")
    )
    text = f'def Xform "w" (\n kind = "group"\n)\n{{\nuniform token model:drawMode = "bounds"\n{instances}}}\n'
    description, _ = translate_text(text + f'class "proto"\n{{\n{BOX}\n def Sphere "s"\n {{\n }}\n}}\n')
    assert [shape.path for shape in description.shapes] == ["/w/a", "/w/b"]
    assert [placed.matrix[0, 3] for placed in description.static] == [0, 1]


def test_origin_is_the_three_axes() -> None:
    mesh = card_mesh('uniform token model:drawMode = "origin"\nfloat3 model:drawModeColor = (1, 0.5, 0)')
    assert mesh.points.max(axis=0) == pytest.approx(1.005, abs=1e-6)
    assert mesh.points.min(axis=0) == pytest.approx(-0.005, abs=1e-6)
    assert len(mesh.triangles) == 3 * 12


def test_bounds_are_twelve_closed_bars_facing_out() -> None:
    mesh = card_mesh('uniform token model:drawMode = "bounds"')
    half = 0.03
    assert mesh.points.max(axis=0) == pytest.approx(np.array([1, 2, 3]) + half)
    assert len(mesh.triangles) == 12 * 12
    a, b, c = (mesh.points[mesh.triangles[:, k]].astype(float) for k in range(3))
    volume = float((a * np.cross(b, c)).sum()) / 6
    lengths = 4 * (2 + 4 + 6 + 3 * 2 * half)
    assert volume == pytest.approx(lengths * (2 * half) ** 2, rel=1e-4)


@pytest.mark.parametrize("geometry", ["box", "cross"])
@pytest.mark.conforms("GeomModelAPI.model:cardGeometry", "GeomModelAPI.model:drawModeColor")
def test_cards_without_textures_are_six_quads_of_the_colour(geometry: str) -> None:
    description, _ = model(
        f'uniform token model:drawMode = "cards"\nuniform token model:cardGeometry = "{geometry}"\n'
        "uniform float3 model:drawModeColor = (0.2, 0.4, 0.6)"
    )
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert len(mesh.triangles) == 12
    assert description.surfaces[0].diffuse_color == pytest.approx((0.2, 0.4, 0.6))
    for k, face in enumerate(FACES):
        assert normals(mesh)[2 * k] == pytest.approx(OUT[face])
        center = mesh.points[4 * k : 4 * k + 4].mean(axis=0)
        away = np.array(OUT[face]) * (1, 2, 3) * (1 if geometry == "box" else 1e-4)
        assert center == pytest.approx(away, rel=0.02, abs=1e-7)


@pytest.fixture
def picture(tmp_path: Path) -> str:
    path = tmp_path / "card.png"
    oiio.ImageBuf(np.ones((2, 2, 4), np.float32)).write(str(path))
    return str(path)


@pytest.mark.parametrize("geometry", ["box", "cross"])
@pytest.mark.parametrize("face", FACES)
@pytest.mark.conforms(
    "GeomModelAPI.model:cardTextureXPos",
    "GeomModelAPI.model:cardTextureYPos",
    "GeomModelAPI.model:cardTextureZPos",
    "GeomModelAPI.model:cardTextureXNeg",
    "GeomModelAPI.model:cardTextureYNeg",
    "GeomModelAPI.model:cardTextureZNeg",
)
def test_textures_lie_as_openusd_lays_them(face: str, geometry: str, picture: str) -> None:
    """Also on the opposite face, where the one texture is seen from behind."""
    mesh = card_mesh(
        f'uniform token model:drawMode = "cards"\nuniform token model:cardGeometry = "{geometry}"\n'
        f"asset model:cardTexture{face} = @{picture}@"
    )
    assert {tuple(np.abs(n).round(3)) for n in normals(mesh)} == {tuple(np.abs(OUT[face]))}
    assert len(mesh.triangles) == 4
    (st,) = mesh.primvars
    right, up = (np.array(v) for v in RIGHT_UP[face])
    size = np.array([2, 4, 6])
    for point, (s, t) in zip(mesh.points, st.values, strict=True):
        assert point @ right == pytest.approx((s - 0.5) * (size @ np.abs(right)), abs=1e-5)
        assert point @ up == pytest.approx((t - 0.5) * (size @ np.abs(up)), abs=1e-5)


def test_a_textured_card_is_cut_out_by_alpha_and_falls_back_to_the_colour(picture: str) -> None:
    description, codes = model(
        f'uniform token model:drawMode = "cards"\nasset model:cardTextureXPos = @{picture}@\n'
        "asset model:cardTextureZPos = @gone.png@\nuniform float3 model:drawModeColor = (0.2, 0.4, 0.6)"
    )
    textured, plain = description.surfaces
    inputs = dict(textured.inputs)
    assert textured.opacity_threshold > 0
    for name, channels in (("diffuse_color", "rgb"), ("opacity", "a")):
        found = inputs[name]
        assert isinstance(found, TextureInput)
        assert found.channels == channels
        assert found.file.path == picture
        assert found.fallback == pytest.approx((0.2, 0.4, 0.6, 1))
    assert (plain.lambert, plain.inputs) == (True, ())
    assert "asset-missing" in codes
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert np.unique(mesh.surface).tolist() == [0, 1]
    assert len(mesh.triangles) == 8  # no cards along Y


@pytest.mark.parametrize(("up", "left"), [("Y", 8), ("Z", 8)])
@pytest.mark.conforms("GeomModelAPI.model:cardVisibility")
def test_simple_visibility_hides_cards_along_the_up_axis(up: str, left: int) -> None:
    text = (
        f'#usda 1.0\n(\n upAxis = "{up}"\n)\ndef Xform "m" (\n kind = "component"\n)\n{{\n{BOX}\n'
        'uniform token model:drawMode = "cards"\nuniform token model:cardVisibility = "simple"\n}\n'
    )
    description, _ = translate_text(text)
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert len(mesh.triangles) == left
    assert np.abs(normals(mesh))[:, "XYZ".index(up)].max() == 0


@pytest.mark.conforms("GeomModelAPI.model:cardGeometry")
def test_cards_from_textures_stand_where_their_metadata_says(tmp_path: Path) -> None:
    placed, bare = tmp_path / "placed.tif", tmp_path / "bare.tif"
    matrix = np.array([[0.5, 0, 0, 0], [0, 0, 1, 0], [0, 0.25, 0, 0], [-1, 0, -7, 1]])  # row vectors: x, z seen from y = 7
    for path in (placed, bare):
        image = oiio.ImageBuf(np.ones((2, 2, 4), np.float32))
        if path == placed:
            image.specmod().attribute("worldtoscreen", oiio.TypeMatrix, tuple(matrix.ravel().tolist()))
        assert image.write(str(path))
    description, codes = model(
        'uniform token model:drawMode = "cards"\nuniform token model:cardGeometry = "fromTexture"\n'
        f"asset model:cardTextureYPos = @{placed}@\nasset model:cardTextureXPos = @{bare}@"
    )
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert mesh.points.tolist() == [[0, 7, -4], [4, 7, -4], [4, 7, 4], [0, 7, 4]]
    assert mesh.primvars[0].values.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    assert "draw-mode-input" in codes


def test_a_model_without_bounds_is_told() -> None:
    text = 'def Xform "m" (\n kind = "component"\n)\n{\nuniform token model:drawMode = "bounds"\n}\n'
    description, diagnostics = translate_text(text)
    assert description.shapes == ()
    assert ("draw-mode-input", "/m") in diagnostics


def test_computed_bounds_leave_out_the_models_own_transform_and_guides() -> None:
    text = """
def Xform "m" (
    kind = "component"
)
{
    uniform token model:drawMode = "bounds"
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Sphere "s"
    {
        double radius = 2
    }
    def Sphere "guide"
    {
        double radius = 20
        uniform token purpose = "guide"
    }
}
"""
    (mesh,) = translate_text(text)[0].shapes
    assert isinstance(mesh, Mesh)
    assert mesh.points.max(axis=0) == pytest.approx(2.02)
