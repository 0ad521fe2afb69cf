"""The compared scenes are the same for everyone, and runners keep to their job."""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdLux

from .peers import loop
from .peers.glass_scenes import GAP, POOL_DEPTH, POOL_SIDE, bulbs, pool
from .peers.moving_scenes import swarm
from .peers.plain import PlainScene
from .peers.scene import Scene
from .peers.scenes import SCENES, field_of_stones, hills
from .peers.shapes import Triangles, ball, block, look_at, rectangle, sky
from .peers.write_plain import LAMP_SHAPES, write_scene


def corners(mesh: Triangles) -> list[np.ndarray]:
    return [mesh.points[mesh.faces[:, k]] for k in range(3)]


def volume(mesh: Triangles) -> float:
    a, b, c = corners(mesh)
    return float((np.cross(a, b) * c).sum() / 6)


def test_closed_meshes_face_outwards():
    assert volume(block((3.0, 1.0, 2.0), (1.0, 2.0, 3.0), 30)) == pytest.approx(48.0)
    assert volume(ball(4, 2.0, (1.0, 0.0, 5.0))) == pytest.approx(4 / 3 * np.pi * 8, rel=0.01)
    assert len(ball(4).faces) == 8 * 4**4


def test_water_is_a_closed_body_that_faces_outwards():
    water = pool().meshes["water"]
    assert volume(water) == pytest.approx(POOL_SIDE**2 * (POOL_DEPTH - GAP), rel=0.02)
    places = np.unique(np.round(water.points, 9), axis=0, return_inverse=True)[1]
    corners_of = places[water.faces]
    edges = np.concatenate([corners_of[:, [0, 1]], corners_of[:, [1, 2]], corners_of[:, [2, 0]]])
    forward, back = ({tuple(edge) for edge in way.tolist()} for way in (edges, edges[:, ::-1]))
    assert forward == back
    assert len(forward) == len(edges)
    assert water.normals is not None
    a, b, c = corners(water)
    assert (np.cross(b - a, c - a) * water.normals[water.faces[:, 0]]).sum(axis=1).min() > 0


def test_globes_are_hollow():
    made = bulbs()
    outside, inside = made.meshes["outside_0"], made.meshes["inside_0"]
    assert volume(outside) == pytest.approx(4 / 3 * np.pi * 0.2**3, rel=0.01)
    assert volume(inside) == pytest.approx(-4 / 3 * np.pi * 0.19**3, rel=0.01)


def test_a_rectangle_faces_along_u_times_v():
    mesh = rectangle((0, 0, 0), (1, 0, 0), (0, 0, 2))
    a, b, c = mesh.points[mesh.faces[0]]
    assert np.cross(b - a, c - a) @ (0, -1, 0) > 0


def test_a_camera_looks_down_its_back():
    matrix = look_at((1, 2, 3), (1, 2, -9))
    np.testing.assert_allclose(matrix, [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-12)


def test_the_sun_is_where_the_sky_says():
    image = sky(256, (0, 0, 1), (0, 0, 1), (0, 0, 0), ((1.0, 0.0, 0.0), 3.0, (9.0, 9.0, 9.0)))
    rows, columns = np.nonzero(image[..., 0] > 5)
    assert columns.mean() == pytest.approx(63.5, abs=0.6)  # +x is a quarter from the left
    assert rows.mean() == pytest.approx(63.5, abs=0.6)


@pytest.mark.parametrize("name", ["box", "lamps"])
def test_usd_and_plain_files_are_one_scene(name, tmp_path):
    write_scene(name, tmp_path)
    plain = PlainScene(tmp_path, name)
    stage = Usd.Stage.Open(str(tmp_path / f"{name}.usdc"))
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert {mesh.GetPrim().GetName() for mesh in meshes} == {mesh for mesh, _ in plain["objects"]}
    colors = {mesh.GetPrim().GetName(): mesh.GetDisplayColorAttr().Get()[0] for mesh in meshes}
    for mesh, look in plain["objects"]:
        assert colors[mesh] == pytest.approx(plain["looks"][look]["color"])
    for k, lamp in enumerate(plain["lamps"]):
        prim = stage.GetPrimAtPath(f"/world/lights/light_{k}")
        light = UsdLux.LightAPI(prim)
        radiance = np.array(light.GetColorAttr().Get()) * light.GetIntensityAttr().Get()
        np.testing.assert_allclose(radiance, lamp["radiance"], rtol=1e-5)
        to_world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
        np.testing.assert_allclose(to_world[3, :3], lamp["center"], atol=1e-6)
        if lamp["kind"] == "rect":
            np.testing.assert_allclose(-to_world[2, :3], (0, -1, 0), atol=1e-6)  # its light goes down
    assert (tmp_path / f"{name}_{plain['objects'][0][0]}.ply").read_bytes().startswith(b"ply\n")


def area(mesh: Triangles) -> float:
    a, b, c = corners(mesh)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_round_lamps_are_the_same_as_lights_and_as_meshes(tmp_path):
    write_scene("studio", tmp_path)
    stage = Usd.Stage.Open(str(tmp_path / "studio.usdc"))
    kinds = set()
    for k, lamp in enumerate(SCENES["studio"]().lamps):
        prim = stage.GetPrimAtPath(f"/world/lights/light_{k}")
        matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
        shape = LAMP_SHAPES[lamp.kind](lamp)
        a, b, c = corners(shape)
        normals = np.cross(b - a, c - a)
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-6)
        if lamp.kind == "disc":
            radius = UsdLux.DiskLight(prim).GetRadiusAttr().Get()
            assert area(shape) == pytest.approx(np.pi * radius**2, rel=1e-3)
            assert (normals @ -matrix[2, :3] > 0).all()  # lights shine along -z
        else:
            light = UsdLux.CylinderLight(prim)
            radius, length = light.GetRadiusAttr().Get(), light.GetLengthAttr().Get()
            assert area(shape) == pytest.approx(2 * np.pi * radius * length, rel=1e-3)
            assert np.ptp((shape.points - lamp.center) @ matrix[0, :3]) == pytest.approx(length)  # they lie along x
            assert (np.sum(normals * ((a + b + c) / 3 - lamp.center), axis=1) > 0).all()
        kinds.add(lamp.kind)
    assert kinds == {"disc", "tube"}


def test_matrices_are_what_an_instancer_makes_of_its_arrays(tmp_path, monkeypatch):
    monkeypatch.setitem(SCENES, "field", lambda: field_of_stones(20))
    write_scene("field", tmp_path)
    stage = Usd.Stage.Open(str(tmp_path / "field.usdc"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/world/geometry/placed"))
    theirs = np.array(instancer.ComputeInstanceTransformsAtTime(Usd.TimeCode.Default(), Usd.TimeCode.Default()))
    ours = PlainScene(tmp_path, "field").matrices()
    np.testing.assert_allclose(theirs.transpose(0, 2, 1), ours, atol=2e-3)  # half floats are not made unit length by USD


def test_what_moves_is_the_same_in_usd_and_plain_files(tmp_path, monkeypatch):
    monkeypatch.setitem(SCENES, "swarm", lambda: swarm(20, 3))
    for name in ("spin", "swarm", "flag"):
        write_scene(name, tmp_path)
    geometry = "/world/geometry"
    plain, stage = PlainScene(tmp_path, "spin"), Usd.Stage.Open(str(tmp_path / "spin.usdc"))
    for mesh, glide in plain["motion"]["glides"].items():
        prim = UsdGeom.Xformable(stage.GetPrimAtPath(f"{geometry}/{mesh}"))
        for at in (-0.5, 0.25, 0.5):
            turn = np.radians(glide["turn_deg"] * at)
            matrix = np.array(prim.ComputeLocalToWorldTransform(at)).T
            np.testing.assert_allclose(matrix[:3, 3], np.add(glide["center"], np.multiply(glide["shift"], at)), atol=1e-9)
            np.testing.assert_allclose(matrix[:3, 0], (np.cos(turn), 0, -np.sin(turn)), atol=1e-6)
    plain, stage = PlainScene(tmp_path, "swarm"), Usd.Stage.Open(str(tmp_path / "swarm.usdc"))
    number, shifts = plain.swarms()
    closing = UsdGeom.PointInstancer(stage.GetPrimAtPath(f"{geometry}/placed")).GetPositionsAttr().Get(0.5)
    np.testing.assert_allclose(closing, plain.matrices()[:, :3, 3] + shifts[number] / 2, atol=1e-5)
    plain, stage = PlainScene(tmp_path, "flag"), Usd.Stage.Open(str(tmp_path / "flag.usdc"))
    points = UsdGeom.Mesh(stage.GetPrimAtPath(f"{geometry}/cloth")).GetPointsAttr()
    np.testing.assert_allclose(points.Get(0.5), plain.ends("cloth"), atol=1e-6)
    still = Usd.Stage.Open(str(tmp_path / "flag_still.usdc"))
    held = UsdGeom.Mesh(still.GetPrimAtPath(f"{geometry}/cloth")).GetPointsAttr()
    np.testing.assert_allclose(held.Get(), points.Get(-0.5), atol=1e-6)


def test_scenes_are_the_same_every_time():
    first, second = (hills(20) for _ in range(2))
    assert isinstance(first, Scene)
    np.testing.assert_array_equal(first.meshes["terrain"].points, second.meshes["terrain"].points)
    assert repr(SCENES["lamps"]().lamps) == repr(SCENES["lamps"]().lamps)


def told(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    lines = capsys.readouterr().out.splitlines()
    return [json.loads(line)["primray-bench"] for line in lines if line.startswith('{"primray-bench"')]


def test_a_runner_stops_before_a_picture_that_takes_too_long(tmp_path, monkeypatch, capsys):
    """A clock that only rendering moves: a tenth of a second a sample."""
    (tmp_path / "box.json").write_text("{}")
    clock = [100.0]
    taken: list[tuple[int, int]] = []

    def render(samples: int, seed: int) -> None:
        taken.append((samples, seed))
        clock[0] += 0.1 * samples
        print("a renderer talks", end="")

    job = {
        "folder": str(tmp_path), "scene": "box", "package": "numpy", "limit_s": 2.0, "total_s": 1e9, "launched": 99.0,
        "pictures": [[4, 7], [16, 8], [64, 9]], "out": str(tmp_path),
    }  # fmt: skip
    monkeypatch.setattr(sys, "argv", ["runner", json.dumps(job)])
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    loop.run(lambda scene, job: (render, lambda path: None, {"load": 0.5}))
    assert taken == [(1, 1), (4, 7), (16, 8)]
    first, *pictures = told(capsys)
    assert first["process_s"] == pytest.approx(1.1)
    assert first["version"] == np.__version__
    assert [picture["samples"] for picture in pictures] == [4, 16]
    assert [picture["seconds"] for picture in pictures] == pytest.approx([0.4, 1.6])
    assert pictures[0]["path"] == f"{tmp_path}/4_7.exr"
    assert float(str(first["peak_mb"])) > 1
