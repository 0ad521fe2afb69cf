"""NurbsPatch prims: each attribute is in the shape that comes out, and what does not fit is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from primray import core
from primray.description import Interpolation, Mesh, NurbsPatch, SceneDescription
from primray.settings import RenderSettings

from ..usd_text import translate_text
from .patch_text import PLANE, SPHERE, SQUARE, patch

SMALL = RenderSettings(resolution=(128, 128))


def read(text: str, told: tuple[str, ...] = (), settings: RenderSettings = SMALL) -> tuple[NurbsPatch, SceneDescription]:
    description, found = translate_text(text, settings)
    assert sorted(code for code, _ in found if code not in ("default-light", "camera-automatic")) == sorted(told)
    (shape,) = description.shapes
    assert isinstance(shape, NurbsPatch)
    return shape, description


def mesh(text: str, told: tuple[str, ...] = ()) -> Mesh:
    _, description = read(text, told)
    (made,) = core.dice(description, SMALL)[0].shapes
    assert isinstance(made, Mesh)
    return made


def area(made: Mesh) -> float:
    a, b, c = (made.points[made.triangles[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.conforms(f"NurbsPatch.{name}"))
        for name in ("uVertexCount", "vVertexCount", "uOrder", "vOrder", "uKnots", "vKnots", "pointWeights")
    ],
)
def test_a_sphere_is_exact_and_needs_all_of_it(name: str) -> None:
    made = mesh(patch(SPHERE))
    assert np.abs(np.linalg.norm(made.points, axis=1) - 1).max() < 3e-7
    (key,) = [key for key in SPHERE if key.endswith(f" {name}")]
    if name == "pointWeights":
        polynomial = mesh(patch({**SPHERE, key: None}))
        assert np.abs(np.linalg.norm(polynomial.points, axis=1) - 1).max() > 0.05
    else:
        assert (("invalid-nurbs", "/p")) in translate_text(patch({**SPHERE, key: None}))[1]


@pytest.mark.parametrize(
    ("side", "form"),
    [
        pytest.param(side, form, marks=pytest.mark.conforms(f"NurbsPatch.{side}Form"))
        for side in "uv"
        for form in ("open", "closed", "periodic")
    ],
)
def test_forms_are_hints(side: str, form: str) -> None:
    """ "The authored points, orders, knots, weights, and ranges are all that is required"."""
    plain, _ = read(patch(SPHERE))
    said, _ = read(patch(SPHERE, f'uniform token {side}Form = "{form}"'))
    assert np.array_equal(plain.points, said.points)
    assert np.array_equal(plain.u.knots, said.u.knots)
    assert replace(plain.v, knots=said.v.knots).count == said.v.count


@pytest.mark.parametrize("side", [pytest.param(s, marks=pytest.mark.conforms(f"NurbsPatch.{s}Range")) for s in "uv"])
def test_ranges(side: str) -> None:
    half = {"u": 0.25, "v": 0.75}[side]
    made = mesh(patch(PLANE, f"double2 {side}Range = (0.25, 0.5)"))
    axis = "uv".index(side)
    assert (made.points[:, axis].min(), made.points[:, axis].max()) == (0.25, 0.5)
    assert area(made) == pytest.approx(0.25)
    # "The maximum must be less than or equal to the last element's value": the surface ends before it where knots go on.
    unclamped = {**PLANE, "double[] uKnots": [-1, 0, 1, 2]}
    assert mesh(patch(unclamped, "double2 uRange = (0, 2)")).points[:, 0].max() == 1
    assert mesh(patch(PLANE, f"double2 {side}Range = (3, 2)"), ("nurbs-data",)).points[:, axis].max() == 1
    assert half


@pytest.mark.parametrize(
    "name", [pytest.param(n.partition(" ")[2], marks=pytest.mark.conforms(f"NurbsPatch.{n.partition(' ')[2]}")) for n in SQUARE]
)
def test_trims(name: str) -> None:
    assert area(mesh(patch({**PLANE, **SQUARE}))) == pytest.approx(0.25, rel=1e-6)
    (key,) = [key for key in SQUARE if key.endswith(name)]
    if name == "trimCurve:ranges":
        ranged = {**PLANE, **SQUARE, key: [(0, 2)]}
        assert area(mesh(patch(ranged), ("nurbs-data",))) == pytest.approx(0.125, rel=1e-6)  # two sides, and told
        return
    wrong = {**PLANE, **SQUARE, key: None}
    assert area(mesh(patch(wrong), ("nurbs-data",))) == pytest.approx(1)


def test_trims_are_homogeneous() -> None:
    """(u w, v w, w)."""
    points = [(3 * u, 3 * v, 3) for u, v in ((0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75), (0.25, 0.25))]
    heavy = {**PLANE, **SQUARE, "double3[] trimCurve:points": points}
    assert area(mesh(patch(heavy))) == pytest.approx(0.25, rel=1e-6)


def test_points_run_along_u_first() -> None:
    wide = {**PLANE, "int uVertexCount": 3, "double[] uKnots": [0, 0, 1, 2, 2]}
    made = mesh(patch({**wide, "point3f[] points": [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]}))
    assert area(made) == pytest.approx(2)
    assert made.normals is not None
    assert (made.normals == (0, 0, 1)).all()  # dP/du x dP/dv
    left = mesh(patch(PLANE, 'uniform token orientation = "leftHanded"'))
    assert left.normals is not None
    assert (left.normals == (0, 0, -1)).all()


TEXTURED = """def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/r.outputs:result>
        token outputs:surface
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
"""
WORN = "rel material:binding = </m>"


def textured(text: str) -> str:
    reader = TEXTURED.replace("color3f inputs:diffuseColor.connect", "float inputs:roughness.connect")
    reader = reader.replace("UsdPrimvarReader_float2", "UsdPrimvarReader_float").replace('"st"', '"k"')
    return reader + text.replace('def NurbsPatch "p"', 'def NurbsPatch "p" (prepend apiSchemas = ["MaterialBindingAPI"])')


@pytest.mark.parametrize(
    ("interpolation", "count", "kind"),
    [
        ("constant", 1, Interpolation.CONSTANT),
        ("uniform", 7 * 3, Interpolation.FACE),
        ("varying", 8 * 4, Interpolation.VARYING),
        ("faceVarying", 8 * 4, Interpolation.VARYING),
        ("vertex", 9 * 5, Interpolation.POINT),
    ],
)
def test_primvars(interpolation: str, count: int, kind: Interpolation) -> None:
    """As RiNuPatch has them: a segment is what lies between two knots, equal ones too."""
    values = [round(0.01 * k, 2) for k in range(count)]
    more = f'{WORN}\nfloat[] primvars:k = {values} (\ninterpolation = "{interpolation}"\n)'
    shape, _ = read(textured(patch(SPHERE, more)))
    (primvar,) = shape.primvars
    assert (primvar.name, primvar.interpolation, len(primvar.values)) == ("k", kind, count)
    bad = more.replace("[0.0", "[0.0, 0.0, 0.5", 1)
    read(textured(patch(SPHERE, bad)), ("invalid-primvar", *(() if interpolation == "constant" else ("primvar-missing",))))


def test_colors() -> None:
    colors = ", ".join(f"(0.{k % 10}, 0.5, 0.5)" for k in range(45))
    made = mesh(patch(SPHERE, f'color3f[] primvars:displayColor = [{colors}] (\ninterpolation = "vertex"\n)'))
    assert made.colors is not None
    assert made.colors.shape == (3 * len(made.triangles), 3)
    assert np.ptp(made.colors[:, 0]) > 0.5


def test_parameters_stand_in_for_texture_coordinates() -> None:
    """From 0 to 1 over what is drawn."""
    settings = replace(SMALL, aovs=("st",))
    ranged, description = read(patch(SPHERE, "double2 uRange = (1, 3)"), settings=settings)
    (made,) = core.dice(description, SMALL)[0].shapes
    (st,) = made.primvars
    assert st.name == "st"
    assert st.values.min(axis=0).tolist() == [0, 0]
    assert st.values.max(axis=0).tolist() == [1, 1]
    assert isinstance(made, Mesh)
    knots = np.isclose(st.values[:, 0], 0.5)
    assert np.abs(made.points[knots, 1]).max() < 1e-6  # u = 2 is where y = 0
    own, _ = read(patch(SPHERE, 'texCoord2f[] primvars:st = [(3, 4)] (\ninterpolation = "constant"\n)'), settings=settings)
    assert own.primvars[0].values.tolist() == [[3, 4]]
    assert ranged.primvars[0].interpolation is Interpolation.VARYING


@pytest.mark.parametrize(
    ("wrong", "code"),
    [
        ({"int uOrder": 1, "double[] uKnots": [0, 0, 1]}, "invalid-nurbs"),
        ({"int uOrder": 3, "double[] uKnots": [0, 0, 1, 1, 1]}, "invalid-nurbs"),
        ({"double[] uKnots": [0, 0, 1]}, "invalid-nurbs"),
        ({"double[] uKnots": [0, 1, 0, 1]}, "invalid-nurbs"),
        ({"double[] uKnots": [0, 1, 1, 1]}, "invalid-nurbs"),
        ({"point3f[] points": [(0, 0, 0)]}, "invalid-nurbs"),
        ({"point3f[] points": [(0, 0, 0), ("inf", 0, 0), (0, 1, 0), (1, 1, 0)]}, "invalid-nurbs"),
        ({"double[] pointWeights": [1, 1, 1]}, "nurbs-data"),
        ({"double[] pointWeights": [1, 1, -1, 1]}, "nurbs-data"),
    ],
)
def test_what_does_not_fit_is_told(wrong: dict[str, object], code: str) -> None:
    text = patch({**PLANE, **wrong}).replace("'inf'", "inf")
    description, told = translate_text(text, SMALL)
    assert (code, "/p") in told
    assert len(description.shapes) == (0 if code == "invalid-nurbs" else 1)


def test_a_sphere_of_glass_is_closed() -> None:
    glass = TEXTURED.replace("color3f inputs:diffuseColor.connect = </m/r.outputs:result>", "float inputs:opacity = 0.2")
    worn = patch(SPHERE, WORN).replace('def NurbsPatch "p"', 'def NurbsPatch "p" (prepend apiSchemas = ["MaterialBindingAPI"])')
    description, _ = translate_text(glass + worn, SMALL)
    open_one = patch({**PLANE}, WORN).replace('"p"', '"p" (prepend apiSchemas = ["MaterialBindingAPI"])', 1)
    flat, _ = translate_text(glass + open_one, SMALL)
    assert not description.surfaces[0].thin
    assert flat.surfaces[0].thin


def test_it_moves() -> None:
    moved = [(x + 1, y, z) for x, y, z in [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]]
    points = PLANE["point3f[] points"]
    text = patch({**PLANE, "point3f[] points": None}, f"point3f[] points.timeSamples = {{ 0: {points}, 1: {moved} }}")
    text += 'def Camera "c"\n{\ndouble shutter:open = 0\ndouble shutter:close = 1\ndouble3 xformOp:translate = (0, 0, 9)\n'
    text += 'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    description, _ = translate_text(text, replace(SMALL, time_code=0.0))
    (made,) = core.dice(description, SMALL)[0].shapes
    assert isinstance(made, Mesh)
    assert made.motion is not None
    assert np.allclose(made.motion.points[-1] - made.points, (1, 0, 0))
