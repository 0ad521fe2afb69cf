"""Plain meshes are handed over together: the picture, its numbers and what edits change are as if each were by itself."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

import primray
from primray.core import shape_upload
from primray.core.shape_upload import ShapeUpload
from primray.description import Mesh
from primray.settings import RenderSettings

SETTINGS = RenderSettings(resolution=(40, 24), spp=4, threads=1)


def boxes() -> Usd.Stage:
    """A row of tetrahedra in turn plain, mirrored, with normals, with colours, and bound to a cut-out; spheres between."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    material, shader = UsdShade.Material.Define(stage, "/holes"), UsdShade.Shader.Define(stage, "/holes/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    reader = UsdShade.Shader.Define(stage, "/holes/reader")
    reader.CreateIdAttr("UsdPrimvarReader_float")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("there")
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).ConnectToSource(reader.ConnectableAPI(), "result")
    shader.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(0.5)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    for k in range(15):
        mesh = UsdGeom.Mesh.Define(stage, f"/row/mesh_{k}")
        size = 0.6 + 0.02 * k
        mesh.CreatePointsAttr([(0, 0, 0), (size, 0, 0), (0, size, 0), (0, 0, size)])
        mesh.CreateFaceVertexCountsAttr([3] * 4)
        mesh.CreateFaceVertexIndicesAttr([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.AddTranslateOp().Set(Gf.Vec3d(k, 0.1 * (k % 3), 0))
        if k % 5 == 1:
            mesh.AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))
        if k % 5 == 2:
            mesh.CreateNormalsAttr([(0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
        colors = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex" if k % 5 == 3 else "constant"
        )
        colors.Set([Gf.Vec3f(k / 15, 0.5, c / 4) for c in range(4 if k % 5 == 3 else 1)])
        if k % 5 == 4:
            UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("there", Sdf.ValueTypeNames.FloatArray, "vertex").Set([0.0, 1.0, 1.0, 1.0])
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
        if k % 4 == 0:
            UsdGeom.Sphere.Define(stage, f"/row/ball_{k}").AddTranslateOp().Set(Gf.Vec3d(k, 2, 0))
    UsdLux.DomeLight.Define(stage, "/sky")
    return stage


def rendered(stage: Usd.Stage) -> tuple[str, np.ndarray, dict[int, str]]:
    picture = primray.render(stage, settings=SETTINGS, aovs=("prim",))
    aov = picture.aovs["prim"]
    assert aov.ids is not None
    return picture.report["pixels_sha256"], np.asarray(aov), dict(aov.ids)


@pytest.mark.parametrize("together", [1, 2, 1 << 14])
def test_one_by_one_and_together(together: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shape_upload, "TOGETHER", together)
    plain, is_plain = list[bool](), ShapeUpload._is_plain

    def noting(self: ShapeUpload, mesh: Mesh) -> bool:
        plain.append(is_plain(self, mesh))
        return plain[-1]

    monkeypatch.setattr(ShapeUpload, "_is_plain", noting)
    bits, numbers, ids = rendered(boxes())
    assert (sum(plain), len(plain)) == (6, 15)
    monkeypatch.setattr(ShapeUpload, "_is_plain", lambda self, mesh: False)
    expected_bits, expected_numbers, expected_ids = rendered(boxes())
    assert (bits, ids) == (expected_bits, expected_ids)
    np.testing.assert_array_equal(numbers, expected_numbers)
    assert len(ids) > 12


def test_one_that_moves_is_placed_again() -> None:
    stage = boxes()
    scene = primray.Scene(stage)
    scene.render(SETTINGS)
    for k in (0, 6, 10):
        stage.GetPrimAtPath(f"/row/mesh_{k}").GetAttribute("xformOp:translate").Set(Gf.Vec3d(k + 0.3, 0.5, 0.2))
        moved = scene.render(SETTINGS)
        assert moved.report["pixels_sha256"] == primray.render(stage, settings=SETTINGS).report["pixels_sha256"]
