"""Instances of curves that overlap become curves of the world; others stay, and so does what tells instances apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt

import primray
from primray.core import overlapping_curves
from primray.core.overlapping_curves import copied_segments, with_curves_in_world
from primray.description import SceneDescription
from primray.incremental import core_update
from primray.settings import RenderSettings
from primray.usd import translate

SETTINGS = RenderSettings(resolution=(48, 27), spp=4, threads=1)
COUNT = 40


def tufts(spacing: float = 0.1, *, sizes: bool = False, colors: bool = False, with_ball: bool = False) -> Usd.Stage:
    """Tufts of two strands in a row, each as wide as one unit."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    head = UsdGeom.PointInstancer.Define(stage, "/head")
    hair = UsdGeom.BasisCurves.Define(stage, "/head/tuft/hair")
    hair.CreateTypeAttr("linear")
    hair.CreateCurveVertexCountsAttr([3, 3])
    hair.CreatePointsAttr([(-0.5, 0, 0), (0, 1, 0.2), (0.5, 2, 0), (0.5, 0, 0), (0, 1, -0.2), (-0.5, 2, 0)])
    hair.CreateWidthsAttr([0.05])
    hair.SetWidthsInterpolation("constant")
    if with_ball:
        UsdGeom.Sphere.Define(stage, "/head/tuft/ball")
    head.CreatePrototypesRel().SetTargets(["/head/tuft"])
    head.CreateProtoIndicesAttr(Vt.IntArray(COUNT))
    head.CreatePositionsAttr([Gf.Vec3f(spacing * k, 0, 0) for k in range(COUNT)])
    if sizes:
        head.CreateScalesAttr([Gf.Vec3f(1, 2, 1)] * COUNT)
    if colors:
        shown = UsdGeom.PrimvarsAPI(head).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex")
        shown.Set([Gf.Vec3f(k / COUNT, 0.5, 0.5) for k in range(COUNT)])
    UsdLux.DomeLight.Define(stage, "/sky")
    box = UsdGeom.Mesh.Define(stage, "/box")
    box.CreatePointsAttr([(-1, 0, -2), (5, 0, -2), (5, 3, -2), (-1, 3, -2)])
    box.CreateFaceVertexCountsAttr([4])
    box.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    box.CreateSubdivisionSchemeAttr("none")
    box.AddTranslateOp().Set(Gf.Vec3d(0, 0, 0))
    return stage


def described(stage: Usd.Stage) -> SceneDescription:
    return translate(stage, SETTINGS)[0]


def copied(picture: primray.Image) -> bool:
    return f"instances of curves as curves of the world ({COUNT})" in {row["name"] for row in picture.report["features"]}


def seen(picture: primray.Image) -> np.ndarray:
    """The name of the instance that each pixel shows."""
    aov = picture.aovs["instance"]
    assert aov.ids is not None
    return np.array([aov.ids.get(int(number), "") for number in np.asarray(aov).ravel()])


def test_overlapping_tufts_are_copied_where_they_are() -> None:
    d = described(tufts())
    made, copies = with_curves_in_world(d, d.shapes)
    assert (len(copies), len(made.placements)) == (COUNT, 0)
    assert made.static == (*d.static, *copies)
    np.testing.assert_allclose([placed.matrix[0, 3] for placed in copies], 0.1 * np.arange(COUNT), rtol=1e-6)
    assert copied_segments(d) == COUNT * 4


@pytest.mark.parametrize(
    "others", [{"spacing": 1.0}, {"sizes": True}, {"colors": True}, {"with_ball": True}], ids=["apart", "wide", "own", "mixed"]
)
def test_other_instances_stay(others: dict[str, float]) -> None:
    d = described(tufts(**others))  # type: ignore[arg-type]
    assert with_curves_in_world(d, d.shapes) == (d, ())
    assert copied_segments(d) == 0


@pytest.mark.parametrize(("limit", "least"), [("MOST_SEGMENTS", COUNT * 4), ("MOST_INSTANCES", COUNT)])
def test_no_more_than_the_limits_are_copied(limit: str, least: int, monkeypatch: pytest.MonkeyPatch) -> None:
    d = described(tufts())
    monkeypatch.setattr(overlapping_curves, limit, least)
    assert len(with_curves_in_world(d, d.shapes)[1]) == COUNT
    monkeypatch.setattr(overlapping_curves, limit, least - 1)
    assert with_curves_in_world(d, d.shapes)[1] == ()


def test_the_picture_and_its_numbers_are_those_of_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    aovs = ("depth", "prim", "instance")
    flat = primray.render(tufts(), settings=SETTINGS, aovs=aovs)
    monkeypatch.setattr(overlapping_curves, "OVERLAPPING", 1e9)
    apart = primray.render(tufts(), settings=SETTINGS, aovs=aovs)
    assert [copied(picture) for picture in (flat, apart)] == [True, False]
    assert (seen(flat) == seen(apart)).mean() > 0.99
    assert len(np.unique(seen(flat))) > COUNT / 2
    np.testing.assert_allclose(flat.aovs["depth"], apart.aovs["depth"], rtol=1e-3)
    np.testing.assert_allclose(np.asarray(flat.pixels), np.asarray(apart.pixels), atol=0.08)


def test_edits_beside_them_give_the_bits_of_a_new_render(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the scene is kept, at the second edit as well."""
    stage, kept = tufts(), list[bool]()
    again = core_update.updated_core_scene

    def noting(*given: Any) -> Any:
        made = again(*given)
        kept.append(made is not None)
        return made

    monkeypatch.setattr(core_update, "updated_core_scene", noting)
    scene = primray.Scene(stage)
    scene.render(SETTINGS)
    seen_bits = set()
    for k in range(1, 4):
        stage.GetPrimAtPath("/box").GetAttribute("xformOp:translate").Set(Gf.Vec3d(0.25 * k, 0.1, -0.5))
        bits = scene.render(SETTINGS).report["pixels_sha256"]
        assert bits == primray.render(stage, settings=SETTINGS).report["pixels_sha256"]
        seen_bits.add(bits)
    assert len(seen_bits) == 3
    assert kept == [True] * 3
