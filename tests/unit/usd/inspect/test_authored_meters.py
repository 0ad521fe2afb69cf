"""Light meters that a stage has: in the world, in native instances, and at the instances of point instancers."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Usd, UsdGeom, Vt

from primray.diagnostics import Diagnostics
from primray.usd.inspect.authored_meters import authored_meters

SCHEMA = "PrimrayLightMeterAPI"


def meter(stage: Usd.Stage, path: str, place: tuple[float, float, float] = (0, 0, 0)) -> None:
    form = UsdGeom.Xform.Define(stage, path)
    form.AddTranslateOp().Set(Gf.Vec3d(*place))
    form.GetPrim().AddAppliedSchema(SCHEMA)


def lamps(stage: Usd.Stage, path: str, prototype: str, positions: list[tuple[float, float, float]]) -> UsdGeom.PointInstancer:
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    instancer.CreatePrototypesRel().AddTarget(prototype)
    instancer.CreateProtoIndicesAttr().Set(Vt.IntArray([0] * len(positions)))
    instancer.CreatePositionsAttr().Set(Vt.Vec3fArray([Gf.Vec3f(*place) for place in positions]))
    return instancer


def places(stage: Usd.Stage) -> dict[str, list[float]]:
    found = authored_meters(stage, None, Diagnostics()).meters
    return {one.path: np.round(one.world_from_prim[:3, 3], 6).tolist() for one in found}


def test_each_instance_of_a_point_instancer_has_its_meters() -> None:
    stage = Usd.Stage.CreateInMemory()
    meter(stage, "/here", (1, 2, 3))
    instancer = lamps(stage, "/lamps", "/lamps/lamp", [(0, 0, 0), (10, 0, 0), (20, 0, 0)])
    UsdGeom.Xformable(instancer).AddTranslateOp().Set(Gf.Vec3d(0, 5, 0))
    UsdGeom.Xform.Define(stage, "/lamps/lamp").AddScaleOp().Set(Gf.Vec3f(2))
    meter(stage, "/lamps/lamp/below", (0, -1, 0))
    instancer.CreateInvisibleIdsAttr().Set(Vt.Int64Array([1]))
    assert places(stage) == {"/here": [1, 2, 3], "/lamps[0]/below": [0, 3, 0], "/lamps[2]/below": [20, 3, 0]}


def test_prototypes_elsewhere_and_instancers_in_instancers() -> None:
    stage = Usd.Stage.CreateInMemory()
    meter(stage, "/row/lamp", (0, 0, 1))
    lamps(stage, "/row/few", "/row/lamp", [(1, 0, 0), (2, 0, 0)])
    outer = lamps(stage, "/rows", "/row", [(0, 100, 0), (0, 200, 0)])
    outer.CreateOrientationsAttr().Set(Vt.QuathArray([Gf.Quath(1, 0, 0, 0), Gf.Quath(0, 0, 0, 1)]))  # half a turn about Z
    found = places(stage)
    # The row itself is in the world, with its lamp and its instances.
    assert {name: found[name] for name in ("/row/lamp", "/row/few[1]")} == {"/row/lamp": [0, 0, 1], "/row/few[1]": [2, 0, 1]}
    assert found["/rows[0]/lamp"] == [0, 100, 1]
    assert found["/rows[0]/few[0]"] == [1, 100, 1]
    assert found["/rows[1]/few[1]"] == [-2, 200, 1]
    assert len(found) == 9


def test_an_instancer_that_draws_itself_ends() -> None:
    stage = Usd.Stage.CreateInMemory()
    meter(stage, "/a")
    lamps(stage, "/a/again", "/a", [(1, 0, 0)])
    assert places(stage)["/a/again[0]/again[0]"] == [2, 0, 0]


def test_meters_of_classes_are_not_in_the_world() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.CreateClassPrim("/lamp")
    meter(stage, "/lamp/below", (0, -1, 0))
    for name, x in (("a", 1.0), ("b", 2.0)):
        placed = UsdGeom.Xform.Define(stage, f"/{name}")
        placed.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        placed.GetPrim().GetReferences().AddInternalReference("/lamp")
        placed.GetPrim().SetInstanceable(name == "b")
    lamps(stage, "/lamps", "/lamp", [(7, 0, 0)])
    assert places(stage) == {"/a/below": [1, -1, 0], "/b/below": [2, -1, 0], "/lamps[0]/below": [7, -1, 0]}
