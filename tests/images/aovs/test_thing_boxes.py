"""Boxes and visibility of things against brute force: projected vertices, and renders of each thing alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

import primray

Points = npt.NDArray[np.float64]
SIZE = (120, 90)
LENS = primray.Distortion(primray.DistortionModel.RATIONAL, (-0.25, 0.05, 0.004, -0.003, 0.01, 0, 0, 0, 0, 0, 0, 0))


def _near(found: Any, expected: Any, tolerance: float = 1e-7) -> None:
    np.testing.assert_allclose(np.array(found), np.array(expected), rtol=1e-7, atol=tolerance)


def _label(prim: Usd.Prim, label: str) -> None:
    prim.CreateAttribute("semantics:labels:class", Sdf.ValueTypeNames.TokenArray).Set([label])


def _cloud(stage: Usd.Stage, path: str, rng: np.random.Generator, count: int = 12) -> None:
    """A mesh of triangles with corners anywhere in a cube of side 2."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in rng.uniform(-1, 1, (3 * count, 3))])
    mesh.CreateFaceVertexCountsAttr([3] * count)
    mesh.CreateFaceVertexIndicesAttr(list(range(3 * count)))
    mesh.CreateSubdivisionSchemeAttr("none")


def _place(prim: Usd.Prim, at: tuple[float, float, float], turn: tuple[float, float, float] = (0, 0, 0), size: Any = 1) -> None:
    form = UsdGeom.Xformable(prim)
    form.AddTranslateOp().Set(Gf.Vec3d(*at))
    form.AddRotateXYZOp().Set(Gf.Vec3f(*turn))
    form.AddScaleOp().Set(Gf.Vec3f(*((size,) * 3 if isinstance(size, int | float) else size)))


def _stage(seed: int = 3) -> Usd.Stage:
    """Rocks of two meshes each: placed alone, in native instances and by an instancer; some overlap, some leave the frame."""
    rng = np.random.default_rng(seed)
    stage = Usd.Stage.CreateInMemory()
    stage.SetMetadata("metersPerUnit", 0.01)
    stage.SetMetadata("upAxis", "Y")
    camera = UsdGeom.Camera.Define(stage, "/cam")
    camera.CreateFocalLengthAttr(24.0)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 1000))
    stage.DefinePrim("/_kind", "Xform").SetSpecifier(Sdf.SpecifierClass)
    _label(stage.GetPrimAtPath("/_kind"), "rock")
    _cloud(stage, "/_kind/a", rng)
    _cloud(stage, "/_kind/sub/b", rng)
    _label(stage.GetPrimAtPath("/_kind/sub"), "moss")
    _place(stage.GetPrimAtPath("/_kind/sub"), (0.3, 0.2, 0.1), (10, 20, 30), (0.5, 1.5, 0.7))
    places = [(-2, 0.5, -9), (-1, 0, -11), (4.2, 1, -9), (1.2, -1.5, -10), (-6.5, 3.6, -9.5)]
    for n, at in enumerate(places):
        prim = stage.DefinePrim(f"/world/rock{n}", "Xform")
        prim.GetInherits().AddInherit("/_kind")
        prim.SetInstanceable(n % 2 == 0)
        _place(prim, at, tuple(rng.uniform(0, 360, 3)), tuple(rng.uniform(0.6, 1.4, 3)))
    plank = UsdGeom.Mesh.Define(stage, "/world/plank")
    plank.CreatePointsAttr([Gf.Vec3f(-6, 3.2, -10), Gf.Vec3f(6, 3.2, -10), Gf.Vec3f(0, 3, -10)])
    plank.CreateFaceVertexCountsAttr([3])
    plank.CreateFaceVertexIndicesAttr([0, 1, 2])
    _label(plank.GetPrim(), "plank")
    lot = UsdGeom.PointInstancer.Define(stage, "/lot")
    stage.DefinePrim("/lot/protos/rock", "Xform").GetInherits().AddInherit("/_kind")
    _place(stage.GetPrimAtPath("/lot/protos/rock"), (0.2, 0, 0), (0, 30, 0))
    lot.CreatePrototypesRel().SetTargets(["/lot/protos/rock"])
    lot.CreateProtoIndicesAttr([0, 0, 0])
    lot.CreatePositionsAttr([Gf.Vec3f(0, 2, -12), Gf.Vec3f(3, -2, -8), Gf.Vec3f(0.3, 1.8, -13)])
    lot.CreateScalesAttr([Gf.Vec3f(1, 1, 1), Gf.Vec3f(0.5, 0.7, 0.9), Gf.Vec3f(0.8, 0.8, 0.8)])
    lot.CreateOrientationsAttr([Gf.Quath(0.5, 0.5, 0.5, 0.5), Gf.Quath(0, 0, 1, 0), Gf.Quath(0.5, -0.5, 0.5, 0.5)])
    _place(lot.GetPrim(), (0, 0.2, 0), (5, 0, 3))
    return stage


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("boxes") / "s.usda"
    stage = _stage()
    stage.GetRootLayer().Export(str(path))
    return path


def _render(path: Any, **settings: Any) -> primray.Image:
    chosen: dict[str, Any] = {
        "camera": "/cam",
        "aovs": ["object_instance:class"],
        "resolution": SIZE,
        "spp": 1,
        "progress": False,
    }
    return primray.render(path, **(chosen | settings))


@pytest.fixture(scope="module")
def image(path: Path) -> primray.Image:
    return _render(path)


@pytest.fixture(scope="module")
def lens_image(path: Path, image: primray.Image) -> primray.Image:
    assert image.camera is not None
    return _render(path, camera=replace(image.camera, path="", distortion=LENS))


# Brute force: every triangle of every thing in the world, by USD alone.


def _roots(stage: Usd.Stage) -> Iterator[tuple[str, Usd.Prim, Points]]:
    """Name, prim and world_from_prim of each labelled prim."""
    cache = UsdGeom.XformCache()
    world = lambda prim: np.array(cache.GetLocalToWorldTransform(prim)).T  # noqa: E731
    for prim in Usd.PrimRange(stage.GetPrimAtPath("/world"), Usd.TraverseInstanceProxies()):
        if prim.HasAttribute("semantics:labels:class"):
            yield str(prim.GetPath()), prim, world(prim)
    lot = UsdGeom.PointInstancer(stage.GetPrimAtPath("/lot"))
    time = Usd.TimeCode.Default()
    root = stage.GetPrimAtPath("/lot/protos/rock")
    for i, matrix in enumerate(lot.ComputeInstanceTransformsAtTime(time, time)):
        of_root = world(lot.GetPrim()) @ np.array(matrix).T
        yield f"/lot[{i}]", root, of_root
        below = stage.GetPrimAtPath("/lot/protos/rock/sub")
        yield f"/lot[{i}]/sub", below, of_root @ np.linalg.inv(world(root)) @ world(below)


def _corners(prim: Usd.Prim, matrix: Points) -> Points:
    """Corners (N, 3, 3) of triangles in the world."""
    cache = UsdGeom.XformCache()
    found = []
    inverse = np.linalg.inv(np.array(cache.GetLocalToWorldTransform(prim)).T)
    for mesh in Usd.PrimRange(prim, Usd.TraverseInstanceProxies()):
        if mesh.IsA(UsdGeom.Mesh):
            m = matrix @ inverse @ np.array(cache.GetLocalToWorldTransform(mesh)).T
            points = np.array(UsdGeom.Mesh(mesh).GetPointsAttr().Get(), np.float64)
            found.append((points @ m[:3, :3].T + m[:3, 3]).reshape(-1, 3, 3))
    return np.concatenate(found)


def _film_box(image: primray.Image, corners: Points, steps: int) -> Points:
    """The box around the edges of triangles, divided into steps."""
    assert image.camera is not None
    s = np.linspace(0, 1, steps + 1)[:, None, None, None]
    points = corners[None] * (1 - s) + np.roll(corners, 1, axis=1)[None] * s
    seen = image.camera.project(points.reshape(-1, 3), SIZE)
    return np.concatenate([seen.min(axis=0), seen.max(axis=0)])


def test_the_box_of_a_thing_is_that_of_its_projected_vertices(path: Path, image: primray.Image) -> None:
    things = {thing.path: thing for thing in image.things}
    checked = 0
    for name, prim, matrix in _roots(Usd.Stage.Open(str(path))):
        expected = _film_box(image, _corners(prim, matrix), 1)
        width, height = SIZE
        on_canvas = (expected[:2] < 2 * np.array(SIZE)).all() and (expected[2:] > -np.array(SIZE)).all()
        assert on_canvas == (name in things)
        if not on_canvas:
            continue
        _near(things[name].box_all, expected, 2e-3)
        clipped = np.clip(expected, 0, [width, height, width, height])
        if (clipped[2:] > clipped[:2]).all():
            _near(things[name].box_loose, clipped, 2e-3)
        else:
            assert things[name].box_loose is None
        checked += 1
    assert checked == len(things) >= 14


def test_lenses_bend_the_edges_of_boxes(path: Path, lens_image: primray.Image) -> None:
    things = {thing.path: thing for thing in lens_image.things}
    bent = 0.0
    for name, prim, matrix in _roots(Usd.Stage.Open(str(path))):
        if name in things:
            corners = _corners(prim, matrix)
            expected = _film_box(lens_image, corners, 64)
            _near(things[name].box_all, expected, 0.05)
            bent = max(bent, float(np.abs(expected - _film_box(lens_image, corners, 1)).max()))
    assert bent > 0.2


def test_oriented_boxes_hold_all_vertices_and_touch_them(path: Path, image: primray.Image) -> None:
    things = {thing.path: thing for thing in image.things}
    for name, prim, matrix in _roots(Usd.Stage.Open(str(path))):
        if name not in things:
            continue
        box = things[name].box_3d
        assert box is not None
        corners = _corners(prim, matrix).reshape(-1, 3)
        world_from_box = np.array(box.world_from_box)
        _near(world_from_box[:3, :3] @ world_from_box[:3, :3].T, np.eye(3), 1e-9)
        assert np.linalg.det(world_from_box[:3, :3]) > 0
        inside = (corners - world_from_box[:3, 3]) @ world_from_box[:3, :3]
        _near(np.abs(inside).max(axis=0), np.array(box.size) / 2, 1e-4)
        _near(-inside.min(axis=0), inside.max(axis=0), 1e-4)
        np.testing.assert_allclose(box.size_m, np.array(box.size) * 0.01)
        np.testing.assert_allclose(box.center, world_from_box[:3, 3])
        assert image.camera is not None
        camera = np.array(image.camera.opencv_camera_from_world)
        _near(box.camera_from_box, camera @ world_from_box, 1e-9)
        _near(box.world_from_prim, matrix, 1e-6)
        own = np.linalg.inv(matrix)
        local = corners @ own[:3, :3].T + own[:3, 3]
        _near(box.extent, [local.min(axis=0), local.max(axis=0)], 1e-4)
        depth = things[name].depth
        z = corners @ camera[2, :3] + camera[2, 3]
        assert depth.nearest == pytest.approx(z.min(), abs=1e-4)
        assert depth.center == pytest.approx(camera[2] @ [*box.center, 1], abs=1e-6)


def _alone(path: Path, name: str, folder: Path) -> Path:
    """The stage with all but one of the top things invisible."""
    stage = Usd.Stage.Open(str(path))
    for prim in stage.GetPrimAtPath("/world").GetChildren():
        if str(prim.GetPath()) != name:
            UsdGeom.Imageable(prim).MakeInvisible()
    lot = UsdGeom.PointInstancer(stage.GetPrimAtPath("/lot"))
    kept = [i for i in range(3) if name != f"/lot[{i}]"]
    lot.CreateInvisibleIdsAttr(kept)
    out = folder / "alone.usda"
    stage.GetRootLayer().Export(str(out))
    return out


@pytest.mark.parametrize("lens", [None, LENS], ids=["pinhole", "lens"])
def test_visibility_is_that_of_each_thing_rendered_alone(
    lens: primray.Distortion | None, path: Path, image: primray.Image, lens_image: primray.Image, tmp_path: Path
) -> None:
    whole = image if lens is None else lens_image
    assert whole.camera is not None
    left, right, bottom, top = whole.camera.window
    wide = (2 * left - right, 2 * right - left, 2 * bottom - top, 2 * top - bottom)
    canvas = replace(whole.camera, path="", window=wide)
    truncated = hidden = 0
    for thing in whole.things:
        if thing.parent is not None:
            continue
        alone = _alone(path, thing.path, tmp_path)
        seen = _render(alone, camera=replace(whole.camera, path="")).aovs["object_instance:class"].values[..., 0]
        larger = _render(alone, camera=canvas, resolution=(3 * SIZE[0], 3 * SIZE[1]))
        every = larger.aovs["object_instance:class"].values[..., 0]
        assert thing.pixels_in_frame == np.count_nonzero(seen)
        assert abs(thing.pixels_all - np.count_nonzero(every)) <= 2  # pixels' centres are rounded otherwise
        assert thing.pixels_visible == whole.mask_of(thing).sum() <= thing.pixels_in_frame
        assert thing.truncation is not None
        assert thing.truncation == 1 - thing.pixels_in_frame / thing.pixels_all
        if thing.pixels_in_frame >= 400:
            assert thing.occlusion == 1 - thing.pixels_visible / thing.pixels_in_frame
        if thing.occlusion is not None:
            assert thing.occlusion_interval is not None
            low, high = thing.occlusion_interval
            assert 0 <= low <= thing.occlusion <= high <= 1
            hidden += 0.05 < thing.occlusion < 1
        truncated += 0.05 < thing.truncation < 1
    assert truncated >= 1
    assert hidden >= 2


@pytest.mark.parametrize("lens", [None, LENS], ids=["pinhole", "lens"])
def test_the_occlusion_of_small_things_has_finer_rays(
    lens: primray.Distortion | None, path: Path, image: primray.Image, lens_image: primray.Image
) -> None:
    """Against pixels an eighth as wide, where those of the picture are off by up to 0.06."""
    whole = image if lens is None else lens_image
    assert whole.camera is not None
    fine = _render(path, camera=replace(whole.camera, path=""), resolution=(8 * SIZE[0], 8 * SIZE[1]))
    exact = {thing.path: thing.occlusion for thing in fine.things}
    held = checked = 0
    for thing in whole.things:
        if thing.pixels_in_frame < 30:
            continue
        truth = exact[thing.path]
        assert truth is not None
        assert thing.occlusion == pytest.approx(truth, abs=0.025)
        assert thing.occlusion_interval is not None
        held += thing.occlusion_interval[0] <= truth <= thing.occlusion_interval[1]
        checked += 1
    assert held >= 0.9 * checked > 10


def _write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "s.usda"
    head = """#usda 1.0
(upAxis = "Y"
metersPerUnit = 1)
def Camera "cam" {
    float focalLength = 20
    float horizontalAperture = 40
    float verticalAperture = 30
    float2 clippingRange = (0.1, 1000)
%s
}
"""
    path.write_text(head % "" + text)
    return path


def _prim(kind: str, name: str, label: str, at: tuple[float, float, float], more: str = "") -> str:
    return f"""def {kind} "{name}" {{
    token[] semantics:labels:class = ["{label}"]
    double3 xformOp:translate = {at}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    {more}
}}
"""


def test_the_box_of_a_sphere_is_that_of_its_outline(tmp_path: Path) -> None:
    path = _write(tmp_path, _prim("Sphere", "ball", "ball", (2, 1, -5), "double radius = 1.5"))
    [ball] = _render(path).things
    assert ball.box_all is not None
    f = SIZE[0] / 2  # 20 mm on 40 mm
    for axis, sign, middle in ((0, 1, SIZE[0] / 2), (1, -1, SIZE[1] / 2)):
        c, d, r = (2.0, 1.0)[axis], 5.0, 1.5
        angle, half = math.atan2(c, d), math.asin(r / math.hypot(c, d))
        ends = sorted(middle + sign * f * math.tan(angle + k * half) for k in (-1, 1))
        _near([ball.box_all[axis], ball.box_all[axis + 2]], ends, 0.01)
    assert ball.depth.nearest == pytest.approx(3.5, abs=1e-5)
    assert ball.box_3d is not None
    np.testing.assert_allclose(ball.box_3d.size, 3.0, rtol=1e-6)


def test_a_thing_that_nothing_shows_is_wholly_hidden(tmp_path: Path) -> None:
    wall = _prim("Cube", "wall", "wall", (0, 0, -6), "double size = 3")
    path = _write(tmp_path, wall + _prim("Cube", "box", "box", (0, 0, -12), "double size = 1"))
    box, wall_thing = _render(path).things
    assert (box.pixels_visible, box.box_tight, box.occlusion) == (0, None, 1.0)
    assert box.pixels_in_frame == box.pixels_all > 0
    assert box.box_loose is not None
    assert (box.kitti_occluded, box.nuscenes_visibility, box.visible_fraction) == (2, 1, 0.0)
    assert (wall_thing.kitti_occluded, wall_thing.nuscenes_visibility, wall_thing.visible_fraction) == (0, 4, 1.0)
    assert box.depth.mean is None
    assert wall_thing.depth.mean == pytest.approx(4.5, rel=1e-6)


def test_a_floor_that_passes_below_the_camera_is_cut_at_its_near_plane(tmp_path: Path) -> None:
    floor = _prim("Cube", "floor", "floor", (0, -2, 0), "float3 xformOp:scale = (30, 0.01, 30)")
    floor = floor.replace('["xformOp:translate"]', '["xformOp:translate", "xformOp:scale"]')
    [thing] = _render(_write(tmp_path, floor)).things
    assert thing.box_loose is not None
    horizon = SIZE[1] / 2 + SIZE[0] / 2 * 1.99 / 30
    _near(thing.box_loose, [0, horizon, *SIZE], 0.01)
    assert thing.truncation is not None
    assert 0.3 < thing.truncation < 1


def test_a_sheared_thing_has_the_extent_of_its_own_space(tmp_path: Path) -> None:
    cube = _prim("Cube", "cube", "cube", (0, 0, -9), "")
    matrix = "matrix4d xformOp:transform = ((1, 0, 0, 0), (1, 1, 0, 0), (0, 0, 2, 0), (0, 0, -9, 1))"
    cube = cube.replace("double3 xformOp:translate = (0, 0, -9)", matrix).replace("xformOp:translate", "xformOp:transform")
    [thing] = _render(_write(tmp_path, cube)).things
    assert thing.box_3d is not None
    _near(thing.box_3d.extent, [[-1, -1, -1], [1, 1, 1]], 1e-5)
    _near(thing.box_3d.size, [4, 2, 4], 1e-5)


def test_keypoints_are_inside_outside_or_hidden(tmp_path: Path) -> None:
    points = """
    token[] primray:keypoints = ["front", "back", "corner"]
    point3f[] primray:keypoints:points = [(0, 0, 1), (0, 0, -1), (1, 1, 1)]
    def Xform "deep" {
        token primray:keypoint = "inside"
        float primray:keypoint:radius = 1.1
    }
    def Xform "shallow" {
        token primray:keypoint = "core"
    }
    def Xform "away" {
        token primray:keypoint = "away"
        double3 xformOp:translate = (40, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    """
    cover = _prim("Cube", "cover", "cover", (0.65, 0.65, -6), "double size = 0.5")
    image = _render(_write(tmp_path, _prim("Cube", "cube", "cube", (0, 0, -9), points) + cover))
    [_, cube] = sorted(image.things, key=lambda thing: len(thing.keypoints))
    found = {point.name: point for point in cube.keypoints}
    assert {name: point.v for name, point in found.items()} == {
        "front": 2,
        "back": 1,
        "corner": 1,
        "inside": 2,
        "core": 1,
        "away": 0,
    }
    assert image.camera is not None
    for point in cube.keypoints:
        _near(point.pixel, image.camera.project([point.position], SIZE)[0], 1e-3)
        assert point.depth == pytest.approx(-point.position[2], rel=1e-6)
    assert found["corner"].position == (1.0, 1.0, -8.0)


def test_equal_hashes_are_reported_and_kept_in_the_table(tmp_path: Path) -> None:
    first, second = "prop4343", "prop40929"
    cubes = "".join(_prim("Cube", name, "prop", (x, 0, -9)) for name, x in ((first, -2.0), (second, 2.0)))
    path, table = _write(tmp_path, f'def Xform "world" {{\n{cubes}}}\n'), tmp_path / "labels.json"
    image = _render(path, label_table=table)
    assert [row["code"] for row in image.report["diagnostics"] if row["code"].startswith("label")] == ["label-clash"]
    ids = {thing.path: thing.id for thing in image.things}
    assert ids == {f"/world/{second}": 299511252, f"/world/{first}": 299511253}
    again = _render(path, label_table=table, mask=[f"/world/{first}", "/cam"])
    assert {thing.path: thing.id for thing in again.things} == {f"/world/{first}": 299511253}
    alone = _render(path, mask=[f"/world/{first}", "/cam"])
    assert {thing.id for thing in alone.things} == {299511252}


ROLLING = """
    double primray:lens:rollingShutter:readout = 1
    double shutter:open = 0
    double shutter:close = 0
"""


def test_boxes_follow_a_rolling_shutter(tmp_path: Path) -> None:
    """A cube falls while rows are read: the picture shows it higher than it is at the frame, and labels agree with it."""
    path = _write(tmp_path, "")
    moving = """
    token[] semantics:labels:class = ["box"]
    double3 xformOp:translate.timeSamples = {0: (-3, 2, -9), 1: (3, -1, -9)}
    uniform token[] xformOpOrder = ["xformOp:translate"]
"""
    text = path.read_text().replace("    float2 clippingRange", ROLLING + "    float2 clippingRange")
    path.write_text(text + f'def Cube "box" {{\n{moving}}}\n')
    image = _render(path, time_code=0.0, spp=4)
    [box] = image.things
    shown = image.pixels[..., 3] > 0.5
    y, x = np.nonzero(shown)
    _near(box.box_tight, [x.min(), y.min(), x.max() + 1, y.max() + 1], 1)
    assert box.box_all is not None
    _near(box.box_all, box.box_tight, 1.01)
    assert abs(shown.sum() - box.pixels_visible) < 0.05 * shown.sum()
    still = _render(path, time_code=0.0, motion_blur=False).things[0]
    assert still.box_all is not None
    assert abs(still.box_all[0] - box.box_all[0]) > 5


MOVING = """
def Mesh "flag" {
    token[] semantics:labels:class = ["flag"]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points.timeSamples = {
        0: [(-3, 0, -9), (-1, 0, -9), (-1, 1, -9), (-3, 1, -9)],
        1: [(-3, 1, -8), (-1, 2, -9), (0, 3, -9), (-3, 2, -9)]
    }
    uniform token subdivisionScheme = "none"
}
class "_rotor" {
    token[] semantics:labels:class = ["rotor"]
    def Cube "blade" {
        double size = 1.5
    }
}
def Xform "rotor0" (
    instanceable = true
    inherits = </_rotor>
) {
    float3 xformOp:rotateXYZ.timeSamples = {0: (0, 0, 0), 1: (40, 70, 20)}
    double3 xformOp:translate.timeSamples = {0: (2, 0, -9), 1: (3, 1, -9)}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Xform "rotor1" (
    instanceable = true
    inherits = </_rotor>
) {
    double3 xformOp:translate = (0, -2, -9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def PointInstancer "swarm" {
    rel prototypes = </swarm/bee>
    int[] protoIndices = [0, 0]
    point3f[] positions.timeSamples = {0: [(-2, -2, -9), (2, -2, -9)], 1: [(-2, -1, -8), (3, -2, -9)]}
    def Sphere "bee" {
        token[] semantics:labels:class = ["bee"]
        double radius = 0.4
    }
}
"""


def test_boxes_of_what_moves_are_those_of_the_frame(tmp_path: Path) -> None:
    """With an open shutter, around which all and the camera move, boxes are those of a still of the frame."""
    path = _write(tmp_path, MOVING)
    still = "    float2 clippingRange"
    shutter = "    double shutter:open = -0.25\n    double shutter:close = 0.25\n"
    shutter += "    double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 1: (0.5, 0.2, 0)}\n"
    shutter += '    uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    path.write_text(path.read_text().replace(still, shutter + still, 1))
    blurred = {thing.path: thing for thing in _render(path, time_code=0.5).things}
    still_things = {thing.path: thing for thing in _render(path, time_code=0.5, motion_blur=False).things}
    assert set(blurred) == set(still_things) == {"/flag", "/rotor0", "/rotor1", "/swarm[0]", "/swarm[1]"}
    for name, thing in blurred.items():
        expected = still_things[name]
        _near(thing.box_all, expected.box_all, 0.02)
        assert thing.box_3d is not None
        assert expected.box_3d is not None
        _near(thing.box_3d.size, expected.box_3d.size, 5e-3)
        _near(thing.box_3d.center, expected.box_3d.center, 5e-3)
        assert abs(thing.pixels_visible - expected.pixels_visible) <= 3
    other = {thing.path: thing for thing in _render(path, time_code=0.25, motion_blur=False).things}
    boxes = [(np.array(other[name].box_all), np.array(blurred[name].box_all)) for name in blurred]
    assert all(abs(a - b).max() > 0.5 for a, b in boxes)


def test_curves_and_points_are_bounded_by_their_outlines(tmp_path: Path) -> None:
    text = """
def BasisCurves "hair" {
    token[] semantics:labels:class = ["hair"]
    uniform token type = "cubic"
    uniform token basis = "bspline"
    int[] curveVertexCounts = [6]
    point3f[] points = [(-3, -1, -9), (-2.5, 1.5, -9), (-1.5, -1, -8), (-1, 1.5, -9), (0, -1, -9), (1, 2, -10)]
    float[] widths = [0.4]
    uniform token primvars:widths:interpolation = "constant"
}
def Points "dust" {
    token[] semantics:labels:class = ["dust"]
    point3f[] points = [(1.5, -2, -9), (3, -1, -8), (2, 1, -12)]
    float[] widths = [0.3, 0.5, 0.8]
}
"""
    dust, hair = _render(_write(tmp_path, text), resolution=(1200, 900)).things
    for thing in (dust, hair):
        _near(thing.box_all, thing.box_tight, 2.0)
        assert thing.box_all is not None
        assert thing.box_tight is not None
        assert thing.box_all[0] <= thing.box_tight[0] + 0.6
        assert thing.box_all[3] >= thing.box_tight[3] - 0.6


BALLS = """
def Sphere "ball" {
    token[] semantics:labels:class = ["ball"]
    float3 xformOp:rotateXYZ = (10, 40, 20)
    float3 xformOp:scale = (1, 2, 0.5)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ", "xformOp:scale"]
}
def Cube "box" {
    token[] semantics:labels:class = ["box"]
    double size = 1
    double3 xformOp:translate = (2, 1, 0)
    float3 xformOp:rotateXYZ = (10, 40, 20)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Sphere "room" {
    token[] semantics:labels:class = ["room"]
    double radius = 300
}
"""
AIM = primray.looking_at((0, 0, 6), (2.5, 0, 0))
CAMERAS = {
    "fisheye": primray.Camera.from_intrinsics(
        [[200, 0, 400], [0, 200, 300], [0, 0, 1]], (800, 600), AIM, (0.01, 0, 0, 0), fisheye=True
    ),
    "wide": primray.Camera.from_field_of_view(90.0, (800, 600), AIM),
    "orthographic": primray.Camera("", AIM, primray.Projection.ORTHOGRAPHIC, (-4.0, 4.0, -3.0, 3.0), (0.1, 1000.0)),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_ellipsoids_and_rooms_are_bounded_in_any_projection(name: str, tmp_path: Path) -> None:
    """By pixels: boxes are those of what is seen, to a pixel; the room is around the camera, and partly behind it."""
    image = _render(_write(tmp_path, BALLS), camera=CAMERAS[name], resolution=(800, 600), allow=["missing"])
    things = {thing.class_name: thing for thing in image.things}
    for label in ("ball", "box"):
        _near(things[label].box_all, things[label].box_tight, 1.0)
    assert things["room"].box_loose == things["room"].box_tight == (0, 0, 800, 600)
    assert things["room"].depth.nearest == 0
