"""Points of lidars against closed forms: ranges, intensities, returns, motion, labels; what is no lidar is an error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray import LidarDetector, LidarPattern
from primray.core import module

HEAD = """#usda 1.0
(
    metersPerUnit = {meters}
    upAxis = "Z"
    timeCodesPerSecond = 24
)
"""
# A quad in the plane x = 0, of a size of 200; its front is -X.
QUAD = """    def Mesh "{name}" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, -100, -100), (0, -100, 100), (0, 100, 100), (0, 100, -100)]
        uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [(0.5, 0.25, 1)]
        double3 xformOp:translate{at}
        uniform token[] xformOpOrder = ["xformOp:translate"]
        {more}
    }}
"""
RAYS = LidarPattern.rotating([-20, -7.5, 0, 3, 15], steps=360, rate_hz=10)
HERE = np.eye(4)


def quad(name: str, at: str, more: str = "") -> str:
    return QUAD.format(name=name, at=at, more=more)


def stage_of(tmp_path: Path, body: str, meters: float = 1.0) -> str:
    path = tmp_path / "stage.usda"
    path.write_text(HEAD.format(meters=meters) + body)
    return str(path)


def placed(x: float, y: float, z: float) -> np.ndarray[Any, Any]:
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def wall_ranges(points: Any, distance: float) -> np.ndarray[Any, Any]:
    """Return the ranges of a wall in front of the sensor."""
    a, e = np.radians(points["azimuth"]), np.radians(points["elevation"])
    return distance / (np.cos(a) * np.cos(e))


def test_ranges_of_a_wall_and_a_floor_are_those_of_planes(tmp_path: Path) -> None:
    floor = """def Mesh "floor"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-500, -500, -2), (500, -500, -2), (500, 500, -2), (-500, 500, -2)]
}
"""
    scan = primray.lidar(stage_of(tmp_path, f'def Xform "w"\n{{\n{quad("wall", " = (12, 0, 0)")}}}\n{floor}'), HERE, RAYS)
    paths = np.array([prim for prim, _ in scan.parts])[scan.points["part"]]
    wall, ground = scan.points[paths == "/w/wall"], scan.points[paths == "/floor"]
    assert len(wall) > 300
    assert len(ground) > 500
    assert np.abs(wall["range"] - wall_ranges(wall, 12)).max() < 5e-5  # at 110 metres
    assert np.abs(wall["x"] - 12).max() < 2e-5
    down = -np.sin(np.radians(ground["elevation"]))
    assert np.abs(ground["range"] - 2 / down).max() < 3e-4  # of a triangle of a kilometre
    assert np.abs(ground["incidence"] - down).max() < 1e-6
    # Firings that meet nothing: upwards, and level or downwards beyond 200 metres, away from the wall.
    assert scan.misses == scan.firings - len(scan.points)
    assert scan.misses > 300


def test_ranges_of_a_sphere_are_the_roots_of_its_quadratic(tmp_path: Path) -> None:
    body = 'def Sphere "ball"\n{\n    double radius = 3\n    double3 xformOp:translate = (20, 1, -2)\n'
    scan = primray.lidar(
        stage_of(tmp_path, body + '    uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'),
        HERE,
        LidarPattern.rotating(np.linspace(-15, 5, 41).tolist(), steps=720),
    )
    d = np.stack([scan.points[axis] for axis in "xyz"], axis=1) / scan.points["range"][:, None]
    center = np.array([20.0, 1.0, -2.0])
    along = d @ center
    assert len(scan.points) > 500
    assert np.abs(scan.points["range"] - (along - np.sqrt(along**2 - center @ center + 9))).max() < 2e-5
    assert (scan.points["number_of_returns"] == 1).all()  # a beam ends at an opaque surface


def test_lengths_are_metres_whatever_the_unit_and_the_place(tmp_path: Path) -> None:
    """A wall at 12 metres in centimetres, a thousand kilometres from the origin."""
    body = f'def Xform "w"\n{{\n{quad("wall", " = (100001200, 0, 0)")}}}\n'
    pattern = LidarPattern.rotating([0, 2], steps=360, sweep_deg=(-2, 2))
    scan = primray.lidar(stage_of(tmp_path, body, 0.01), placed(1e8, 0, 0), pattern)
    assert len(scan.points) == pattern.count
    assert np.abs(scan.points["range"] - wall_ranges(scan.points, 12)).max() < 1e-5
    assert np.abs(scan.points["world_x"] - 100001200).max() < 1e-3
    assert np.abs(scan.positions("world")[:, 0] - 1000012).max() < 1e-5


def test_intensity_is_albedo_times_cosine_at_any_distance(tmp_path: Path) -> None:
    path = stage_of(tmp_path, f'def Xform "w"\n{{\n{quad("wall", " = (12, 0, 0)")}}}\n')
    pattern = LidarPattern.rotating([0, 5, 30], steps=360)
    for weights, albedo in (((1.0, 0.0, 0.0), 0.5), ((0.0, 0.5, 0.5), 0.625)):
        points = primray.lidar(path, HERE, pattern, detector=LidarDetector(weights=weights)).points
        cosine = points["x"] / points["range"]
        assert np.abs(points["incidence"] - cosine).max() < 1e-6
        assert np.abs(points["intensity"] - albedo * cosine).max() < 1e-6
    points = primray.lidar(path, HERE, pattern, detector=LidarDetector(reference_range_m=24, min_intensity=0.3)).points
    wanted = 0.5 * points["x"] / points["range"] * (24 / points["range"]) ** 2
    assert np.abs(points["intensity"] - wanted).max() < 1e-5
    assert points["intensity"].min() >= 0.3


PANE = """def Material "glass"
{{
    token outputs:surface.connect = </glass/shader.outputs:surface>
    def Shader "shader"
    {{
        uniform token info:id = "{model}"
        {inputs}
        token outputs:{output}
    }}
}}
"""
CLEAR = "float inputs:opacity = 0\n        float inputs:roughness = 0\n        float inputs:ior = 1.5"
SLAB = """def Cube "pane" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    double size = 1
    rel material:binding = </glass>
    double3 xformOp:translate = (5.005, 0, 0)
    double3 xformOp:scale = (0.01, 40, 40)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
"""


def test_a_pane_of_glass_and_what_is_behind_it_are_two_returns(tmp_path: Path) -> None:
    """At normal incidence both faces of a pane reflect, (1 - R)^4 of the light comes back from behind it, and light takes 1.5
    times as long through it."""
    glass = PANE.format(model="UsdPreviewSurface", inputs=CLEAR, output="surface")
    path = stage_of(tmp_path, f'{glass}{SLAB}def Xform "w"\n{{\n{quad("wall", " = (12, 0, 0)")}}}\n')
    ahead = LidarPattern.rotating([0], steps=1, range_m=(0.3, 50))
    scan = primray.lidar(path, HERE, ahead)
    assert [prim for prim, _ in (scan.parts[part] for part in scan.points["part"])] == ["/pane", "/w/wall"]
    assert scan.points["return_number"].tolist() == [1, 2]
    assert scan.points["number_of_returns"].tolist() == [2, 2]
    assert np.abs(scan.points["range"] - [5, 12.005]).max() < 1e-6
    assert scan.points["intensity"][1] == pytest.approx(0.5 * 0.96**4, rel=1e-5)
    # GGX of alpha 0.05: R D / 4 pi at its peak is R / (4 alpha^2), and again behind one face.
    assert scan.points["intensity"][0] == pytest.approx(0.04 / (4 * 0.05**2) * (1 + 0.96**2 * 0.96**2), rel=0.1)
    # Faces a centimetre apart are told apart where the detector can.
    fine = primray.lidar(path, HERE, ahead, detector=LidarDetector(separation_m=0.001))
    assert np.abs(fine.points["range"] - [5, 5.015, 12.005]).max() < 1e-6
    # Of several returns the first, the last, or the strongest is kept.
    for keep, ranges in (("first", [5]), ("last", [12.005]), ("strongest", [5])):
        kept = primray.lidar(path, HERE, ahead, detector=LidarDetector(returns=1, keep=keep)).points
        assert np.abs(kept["range"] - ranges).max() < 1e-6
        assert kept["number_of_returns"].tolist() == [1]


def test_glass_absorbs_by_its_thickness(tmp_path: Path) -> None:
    """A quarter of the red light is left after a centimetre, and a quarter of that on the way back."""
    inputs = """float inputs:transmission_weight = 1
        float inputs:specular_roughness = 0
        color3f inputs:transmission_color = (0.25, 1, 1)
        float inputs:transmission_depth = 0.01"""
    glass = PANE.format(model="ND_open_pbr_surface_surfaceshader", inputs=inputs, output="out")
    glass = glass.replace("outputs:surface>", "outputs:out>")
    path = stage_of(tmp_path, f'{glass}{SLAB}def Xform "w"\n{{\n{quad("wall", " = (12, 0, 0)")}}}\n')
    points = primray.lidar(path, HERE, LidarPattern.rotating([0], steps=1)).points
    assert points["intensity"][-1] == pytest.approx(0.5 * 0.96**4 * 0.25**2, rel=3e-3)


def test_beams_refract_in_glass(tmp_path: Path) -> None:
    """Through a pane at 40 degrees: Snell's law gives the path in glass, and the reflection is too far aside to return."""
    glass = PANE.format(model="UsdPreviewSurface", inputs=CLEAR, output="surface")
    path = stage_of(tmp_path, f'{glass}{SLAB}def Xform "w"\n{{\n{quad("wall", " = (12, 0, 0)")}}}\n')
    aside = LidarPattern.rotating([0], azimuths_deg=[40], steps=1)
    points = primray.lidar(path, HERE, aside).points
    a = np.radians(40)
    inside = np.arcsin(np.sin(a) / 1.5)
    assert len(points) == 1
    assert points["range"][0] == pytest.approx((12 - 0.01) / np.cos(a) + 1.5 * 0.01 / np.cos(inside), abs=5e-6)


@pytest.mark.parametrize(
    ("model", "inputs", "output", "share"),
    [
        (
            "ND_open_pbr_surface_surfaceshader",
            "float inputs:transmission_weight = 1\n float inputs:specular_roughness = 0",
            "out",
            0.96**4,
        ),
        (
            "UsdPreviewSurface",
            'float inputs:opacity = 0.25\n token inputs:opacityMode = "presence"\n float inputs:ior = 1',
            "surface",
            0.75**2,
        ),
    ],
)
def test_what_gets_through_is_squared(tmp_path: Path, model: str, inputs: str, output: str, share: float) -> None:
    """Closed OpenPBR glass loses 4 % at each of two faces, there and back; of a screen one face lets 3 of 4 rays through, there
    and back."""
    glass = PANE.format(model=model, inputs=inputs, output=output).replace("outputs:surface>", f"outputs:{output}>")
    pane = (
        SLAB if output == "out" else quad("pane", " = (5, 0, 0)", "rel material:binding = </glass>").replace("    def", "def")
    )
    path = stage_of(tmp_path, f'{glass}{pane}def Xform "w"\n{{\n{quad("wall", " = (12, 0, 0)")}}}\n')
    points = primray.lidar(path, HERE, LidarPattern.rotating([0], steps=1)).points
    assert len(points) == 2
    assert points["range"][0] == pytest.approx(5, abs=1e-6)
    assert points["intensity"][1] == pytest.approx(0.5 * share, rel=1e-4)


def test_a_wall_that_moves_is_where_it_is_when_each_beam_is_fired(tmp_path: Path) -> None:
    """24 codes a second: 10 metres a second towards the sensor, over the tenth of a second that a turn takes."""
    moving = ".timeSamples = { 0: (12, 0, 0), 24: (2, 0, 0) }"
    path = stage_of(tmp_path, f'def Xform "w"\n{{\n{quad("wall", moving)}}}\n')
    pattern = LidarPattern.rotating([0, 10], steps=900, times_s=[0, 1e-5])
    points = primray.lidar(path, HERE, pattern, time_code=0).points
    assert len(points) > 500
    assert points["time"].max() > 0.09
    assert np.abs(points["range"] - wall_ranges(points, 1) * (12 - 10 * points["time"])).max() < 5e-5
    still = primray.lidar(path, HERE, pattern, time_code=0, motion_blur=False).points
    assert np.abs(still["range"] - wall_ranges(still, 12)).max() < 5e-5


def test_a_spinning_sensor_on_a_moving_carrier(tmp_path: Path) -> None:
    """The carrier drives at 10 m/s and turns by 90 degrees a second; points are those of the pose at each firing."""
    carrier = """def Xform "car"
{
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 24: (10, 0, 0) }
    float xformOp:rotateZ.timeSamples = { 0: 0, 24: 90 }
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
    def Xform "lidar"
    {
        token primray:lidar:pattern = "rotating-16"
        float[] primray:lidar:elevations = [-5, 0, 5]
        float[] primray:lidar:times = [0, 1e-5, 2e-5]
        int primray:lidar:steps = 2000
    }
}
"""
    path = stage_of(tmp_path, f'{carrier}def Xform "w"\n{{\n{quad("wall", " = (30, 0, 0)")}}}\n')
    scan = primray.lidar(path, time_code=0)
    points = scan.points
    assert scan.sensor == "/car/lidar"
    assert scan.pattern.range_m == (0.3, 100)
    t, e = points["time"], np.radians(points["elevation"])
    a = 2 * np.pi * points["column"] / 2000 + np.radians(90 * t)
    assert len(points) > 2000
    assert t.max() > 0.09
    assert np.abs(points["range"] - (30 - 10 * t) / (np.cos(a) * np.cos(e))).max() < 2e-4
    assert np.abs(points["world_x"] - 30).max() < 2e-4
    # Points in the axes of the frame's beginning are those of the world there.
    start = scan.positions("start")
    assert np.abs(start[:, 0] - 30).max() < 2e-4
    assert np.abs(scan.positions()[:, 0] - 30).max() > 0.5


def test_labels_are_of_the_things_that_beams_hit(tmp_path: Path) -> None:
    thing = """def Xform "{name}" (
    prepend apiSchemas = ["SemanticsLabelsAPI:class"]
)
{{
    token[] semantics:labels:class = ["{label}"]
{inside}}}
"""
    body = thing.format(name="house", label="building", inside=quad("front", " = (12, 0, 0)"))
    body += thing.format(name="house2", label="building", inside=quad("back", " = (-9, 0, 0)"))
    path = stage_of(tmp_path, body + thing.format(name="post", label="barrier", inside='    def Sphere "ball"\n    {\n    }\n'))
    scan = primray.lidar(path, placed(0, 0, 3), RAYS)
    assert scan.classes == {1: "barrier", 2: "building"} or scan.classes == {2: "building"}
    front = scan.points["world_x"] > 11
    ids = {name: number for number, name in scan.objects.items()}
    assert (scan.points["object_id"][front] == ids["/house"]).all()
    assert (scan.points["object_id"][scan.points["world_x"] < -8] == ids["/house2"]).all()
    assert (scan.points["class_id"][front] == 2).all()
    # Those of pictures.
    image = primray.render(
        path,
        camera=[[0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 3], [0, 0, 0, 1]],
        resolution=(8, 8),
        spp=1,
        aovs=["object_instance:class"],
    )
    assert set(np.unique(image.aovs["object_instance:class"].values)) == {ids["/house"]}
    assert primray.lidar(path, HERE, RAYS, taxonomy="kind").objects == {}


BALL = """def Sphere "ball"
{
    double radius = 2
    double3 xformOp:translate = (7, 3, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_a_scan_is_the_same_for_any_threads_and_lanes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    glass = PANE.format(model="UsdPreviewSurface", inputs=CLEAR, output="surface")
    path = stage_of(
        tmp_path,
        f'{glass}{SLAB}{BALL}def Xform "w"\n{{\n{quad("wall", " = (12, 0, 0)")}}}\n',
    )
    detector = LidarDetector(range_noise_m=0.01, seed=3)
    scan = primray.lidar(path, HERE, RAYS, detector=detector, threads=1)
    assert len(scan.points) > 300
    assert primray.lidar(path, HERE, RAYS, detector=detector, threads=3).points.tobytes() == scan.points.tobytes()
    for lanes in (each for each in (1, 4, 8, 16) if module().has_lanes(each)):
        monkeypatch.setattr("primray.core.passes.lanes", lambda lanes=lanes: lanes)
        assert primray.lidar(path, HERE, RAYS, detector=detector).points.tobytes() == scan.points.tobytes()
