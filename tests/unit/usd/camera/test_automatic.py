"""The automatic camera: all that is drawn inside the frame, tight, with a margin; what would make it a dot is left out."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from primray.arrays import Doubles
from primray.description import Camera, Mesh, Placed, SceneDescription, SubdivisionMesh
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.camera import framed_objects as drawn_module
from primray.usd.camera.automatic import GROUND_MARGIN, MARGIN

from ..usd_text import stage_of, translate_text

CODE = "camera-automatic"


def cube(name: str, at: tuple[float, float, float], scale: tuple[float, float, float] = (1, 1, 1), more: str = "") -> str:
    return f"""def Cube "{name}"
{{
    {more}
    double size = 1
    double3 xformOp:translate = {at}
    float3 xformOp:scale = {scale}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}}
"""


def sphere(name: str, radius: float) -> str:
    return f'def Sphere "{name}"\n{{\n    double radius = {radius}\n}}\n'


KITCHEN = "".join(cube(f"k{n}", (n % 3 - 1, 0.5 + n // 6, n % 2 * 1.5), (0.6, 1, 0.4 + n / 9)) for n in range(9))
SHOWN = [f"/k{n}" for n in range(9)]


def z_up(text: str) -> str:
    return f'#usda 1.0\n(\n    upAxis = "Z"\n)\n{text}'


def pixels_of(description: SceneDescription, paths: list[str] | None = None) -> Doubles:
    """Where the vertices of these shapes are on the picture, from (0, 0) to (1, 1)."""
    width, height = description.resolution
    found = []
    for placed in description.static:
        shape = description.shapes[placed.shape]
        if not isinstance(shape, Mesh | SubdivisionMesh) or (paths is not None and shape.path not in paths):
            continue
        world = shape.points @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]
        found.append(description.camera.project(world, (width, height)) / (width, height))
    return np.concatenate(found)


def assert_fits(pixels: Doubles) -> None:
    """With the margin on all sides; on two facing ones no more than that, and as much on both, however tall or wide."""
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    assert (low >= MARGIN - 1e-6).all()
    assert (high <= 1 - MARGIN + 1e-6).all()
    np.testing.assert_allclose(low, 1 - high, atol=2e-3)
    assert (low <= MARGIN + 1e-6).any()


SIZES = [(320, 240), (240, 320), (1000, 100), (64, 64)]


@pytest.mark.parametrize("resolution", SIZES)
@pytest.mark.parametrize("header", ["", z_up("")])
def test_all_corners_are_inside_with_a_margin(resolution: tuple[int, int], header: str) -> None:
    description, found = translate_text(header + KITCHEN, RenderSettings(resolution=resolution))
    assert_fits(pixels_of(description))
    assert "left out" not in message_of(header + KITCHEN)
    assert (CODE, "") in found


@pytest.mark.parametrize("header", ["", z_up("")])
def test_a_ground_that_is_added_is_framed_where_it_is_near(header: str) -> None:
    """The ground around the set, some way out by the set's height, is inside the frame with the margin."""
    up = 2 if header else 1
    description, _ = translate_text(header + KITCHEN, RenderSettings(resolution=(320, 240), ground="shadow"))
    things = drawn_module.framed_objects(description.shapes, description.static, (), ())
    low, high = things.low.min(axis=0), things.high.max(axis=0)
    room = np.full(3, GROUND_MARGIN * (high[up] - low[up]))
    corners = np.array([[(low - room, high + room)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    corners[:, up] = low[up]
    seen = description.camera.project(corners, (320, 240)) / (320, 240)
    assert_fits(np.concatenate([seen, pixels_of(description)]))
    plain, _ = translate_text(header + KITCHEN, RenderSettings(resolution=(320, 240)))
    assert (plain.camera.project(corners, (320, 240)) > 240 * (1 - MARGIN)).any()


@pytest.mark.parametrize("policy", ["cropAperture", "adjustApertureWidth", "adjustPixelAspectRatio", "expandAperture"])
def test_whatever_the_frame_is_conformed_to(policy: str) -> None:
    settings = 'def RenderSettings "s"\n{\n    uniform int2 resolution = (300, 80)\n    uniform float pixelAspectRatio = 2\n'
    settings += f'    uniform token aspectRatioConformPolicy = "{policy}"\n}}\n'
    assert_fits(pixels_of(translate_text(KITCHEN + settings)[0]))


def message_of(text: str, settings: RenderSettings | None = None) -> str:
    _, diagnostics = translate(stage_of(text), settings or RenderSettings())
    (message,) = [d.message for d in diagnostics if d.code == CODE]
    return message


def axes_of(camera: Camera) -> Doubles:
    return camera.world_from_camera[:3, :3]


def test_it_stands_in_front_to_the_right_above() -> None:
    back = axes_of(translate_text(KITCHEN)[0].camera)[:, 2]
    assert (back > 0.3).all()
    axes = axes_of(translate_text(z_up(KITCHEN))[0].camera)
    assert (axes[:, 2] * (1, -1, 1) > 0.3).all()
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes[2, 0] == pytest.approx(0)  # level


GROUND = cube("ground", (3, -0.01, 5), (10_000 / 50, 0.02, 10_000 / 50))  # a hundred metres under five, in these units
SKY = sphere("sky", 350_000)
DOME = 'def Xform "env"\n{\n' + cube("dome", (0, 175_000, 0), (700_000, 350_000, 700_000)) + "}\n"
STRAY = cube("stray", (1e6, 40, -3e5), (2, 2, 2))


@pytest.mark.parametrize(
    ("more", "names"),
    [
        (GROUND, ["/ground"]),
        (SKY, ["/sky"]),
        (DOME, ["/env/dome"]),
        (STRAY, ["/stray"]),
        (GROUND + SKY, ["/ground", "/sky"]),
        (GROUND + SKY + STRAY, ["/ground", "/sky", "/stray"]),
        (GROUND + DOME + cube("water", (0, -0.05, 0), (200, 0.01, 200)), ["/env/dome", "/ground", "/water"]),
    ],
)
def test_what_would_make_the_set_a_dot_is_left_out_and_named(more: str, names: list[str]) -> None:
    text = more + KITCHEN
    assert_fits(pixels_of(translate_text(text)[0], SHOWN))
    message = message_of(text)
    assert all(name in message for name in names)
    assert "/k" not in message


def test_one_thing_on_a_ground_under_a_sky() -> None:
    text = z_up(cube("pot", (0, 0, 0.5)) + cube("ground", (0, 0, 0), (100, 100, 0)) + SKY)
    assert_fits(pixels_of(translate_text(text)[0], ["/pot"]))


@pytest.mark.parametrize(
    "more",
    [
        cube("ground", (0, 0, 0), (9, 0.01, 9)),  # not so much wider
        cube("room", (0, 1.5, 0), (8, 4, 8)),  # encloses all, as a room does
        cube("tower", (0, 50, 0), (2, 100, 2)),
        cube("road", (0, 0, 0), (60, 0.01, 3)),  # does not go around all
        cube("other", (20, 0, 0), (4, 4, 4)),
        "".join(cube(f"far{n}", (1000 * n, 0, 0)) for n in range(1, 9)),  # no majority
        "".join(cube(f"path{n}", (5**n, 0, 0)) for n in range(1, 5)),  # one thing leads to the next
    ],
)
def test_ordinary_sets_are_framed_whole(more: str) -> None:
    assert "left out" not in message_of(KITCHEN + more)
    assert_fits(pixels_of(translate_text(KITCHEN + more)[0]))


@pytest.mark.parametrize(
    "small",
    [
        cube("small", (0, 0, 0)),
        cube("small", (0, 4.6, 0)),
        cube("small", (3, 1, 5.3)),
        cube("small", (0, 0, 4.8)) + cube("lens", (0, 0, 5.2), (0.5, 0.5, 0.5)),
        cube("small", (0, 5.2, 0)) + cube("lens", (0.2, 5.3, 0), (0.5, 0.5, 0.5)),
    ],
)
@pytest.mark.parametrize("height", [10, 1])
def test_of_two_things_the_larger_one_is_kept(small: str, height: float) -> None:
    """A small part in, on or at the side of a thing ten times as large, flat or not, does not make that its surroundings."""
    body = cube("body", (0, 0, 0), (10, height, 10))
    text = body + small if height == 10 else body + cube("small", (2, 1, 2))
    assert "left out" not in message_of(text)
    assert_fits(pixels_of(translate_text(text)[0]))


def test_what_is_not_drawn_does_not_count() -> None:
    camera = translate_text(KITCHEN)[0].camera
    hidden = cube("hidden", (15, 0, 0), more='token visibility = "invisible"')
    guide = cube("guide", (15, 0, 0), more='uniform token purpose = "guide"')
    proxy = cube("proxy", (15, 0, 0), more='uniform token purpose = "proxy"')
    assert translate_text(KITCHEN + hidden + guide + proxy)[0].camera == camera
    shown = translate_text(KITCHEN + proxy, RenderSettings(purposes=("default", "proxy")))[0].camera
    assert shown != camera


def test_authored_extents_do_not_count() -> None:
    extent = "float3[] extent = [(-900, -900, -900), (900, 900, 900)]"
    text = KITCHEN + cube("k9", (0, 0, 0), more=extent)
    assert_fits(pixels_of(translate_text(text)[0]))


def test_spheres_and_turned_shapes_are_framed_by_themselves_not_by_their_boxes() -> None:
    description = translate_text(sphere("ball", 3), RenderSettings(resolution=(200, 100)))[0]
    back = axes_of(description.camera)[:, 2]
    camera_from_center = np.linalg.norm(description.camera.world_from_camera[:3, 3])
    top = description.camera.window[3] * (1 - 2 * MARGIN)
    assert camera_from_center * np.sin(np.arctan(top)) == pytest.approx(3)  # the cone touches the sphere
    np.testing.assert_allclose(description.camera.world_from_camera[:3, 3], back * camera_from_center, atol=1e-9)


def test_what_reaches_farther_though_its_box_does_not() -> None:
    """Corners of the ball's box lie outside the cubes, the ball's surface inside."""
    corners = [tuple(6.0 * s - 3.0 for s in corner) for corner in np.ndindex(2, 2, 2)]
    cubes = "".join(cube(f"c{n}", (x, y, z), (0.1, 0.1, 0.1)) for n, (x, y, z) in enumerate(corners))
    assert translate_text(sphere("ball", 3.2) + cubes)[0].camera == translate_text(cubes)[0].camera


def test_boxes_that_are_not_finite_are_no_boxes() -> None:
    shape = translate_text(cube("a", (0, 0, 0)))[0].shapes[0]
    beyond, overflowing = np.diag([1e200, 1, 1, 1]), np.diag([1e308, 1, 1, 1])
    overflowing[0, 3] = 1.7e308
    found = drawn_module.framed_objects([shape], [Placed(0, m) for m in (np.eye(4), beyond, overflowing)], [], [])
    np.testing.assert_allclose([found.low, found.high], [[[-0.5] * 3], [[0.5] * 3]])


def test_a_level_plane_is_seen_from_above_and_an_upright_one_from_the_front() -> None:
    for text in (cube("floor", (0, 0, 0), (2, 0, 2)), cube("poster", (0, 0, 0), (3, 2, 0)), cube("side", (0, 0, 0), (0, 2, 3))):
        pixels = pixels_of(translate_text(text)[0])
        assert_fits(pixels)
        assert (np.ptp(pixels, axis=0) > 0.2).all()


@pytest.mark.parametrize(("place", "size"), [(1e7, 1.0), (0.0, 1e-6), (0.0, 1e12), (1e12, 1e9)])
def test_sets_of_any_size_anywhere(place: float, size: float) -> None:
    text = cube("a", (place, place, -place), (size, size, size)) + cube("b", (place + size, place, -place), (size, size, size))
    pixels = pixels_of(translate_text(text)[0])
    assert (pixels >= MARGIN - 1e-3).all()
    assert (pixels <= 1 - MARGIN + 1e-3).all()
    assert np.ptp(pixels, axis=0).max() > 0.8


def test_nothing_but_lights_and_nothing_at_all() -> None:
    for text in ("", 'def SphereLight "l"\n{\n    double3 xformOp:translate = (500, 0, 0)\n}\n'):
        camera = translate_text(text)[0].camera
        assert np.isfinite(camera.world_from_camera).all()
        assert np.linalg.norm(camera.world_from_camera[:3, 3]) < 10


def test_a_mesh_light_counts_only_where_nothing_else_is_drawn() -> None:
    light = cube("lamp", (0, 8, 0)).replace('def Cube "lamp"', 'def Cube "lamp" (prepend apiSchemas = ["MeshLightAPI"])')
    light = light.replace("Cube", "Mesh").replace("double size = 1", MESH)
    assert translate_text(KITCHEN + light)[0].camera == translate_text(KITCHEN)[0].camera
    assert_fits(pixels_of(translate_text(light)[0]))


MESH = """point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 1, 1)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
"""


def test_points_that_no_face_has_do_not_count() -> None:
    mesh = cube("m", (0, 0, 0)).replace("Cube", "Mesh").replace("double size = 1", MESH.replace("[(", "[(9, 9, 900), (", 1))
    mesh = mesh.replace("[0, 1, 2, 3]", "[1, 2, 3, 4]")
    description = translate_text(mesh)[0]
    shape = description.shapes[0]
    assert isinstance(shape, Mesh | SubdivisionMesh)
    width, height = description.resolution
    assert_fits(description.camera.project(shape.drawn_points(), (width, height)) / (width, height))


def instancer(positions: Doubles) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    points = UsdGeom.PointInstancer.Define(stage, "/p")
    UsdGeom.Sphere.Define(stage, "/p/ball")
    points.CreatePrototypesRel().AddTarget("/p/ball")
    points.CreateProtoIndicesAttr(Vt.IntArray(len(positions)))
    points.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions.astype(np.float32)))
    return stage


def test_instances_are_framed_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    places = np.random.default_rng(2).uniform(-50, 50, (500, 3)).round(3)
    alone = translate(instancer(places), RenderSettings())[0].camera
    reach = distances(alone, places)
    assert reach.max() == pytest.approx(0, abs=1e-5)  # a sphere touches the frame's margin, none crosses it
    monkeypatch.setattr(drawn_module, "MOST_BOUNDED_INSTANCES", 10)
    assert distances(translate(instancer(places), RenderSettings())[0].camera, places).max() < -1  # by the box around all


def distances(camera: Camera, places: Doubles) -> Doubles:
    """By how much unit spheres at these places cross the frame's margin."""
    local = (places - camera.world_from_camera[:3, 3]) @ camera.world_from_camera[:3, :3]
    inside = 1 - 2 * MARGIN
    x, y = camera.window[1] * inside, camera.window[3] * inside
    planes = [np.array([s, 0, x]) / np.hypot(1, x) for s in (-1, 1)] + [np.array([0, s, y]) / np.hypot(1, y) for s in (-1, 1)]
    return np.asarray(local @ np.array(planes).T + 1.0)


def test_a_stray_instance_is_named_by_its_instancer() -> None:
    places = np.random.default_rng(2).uniform(-5, 5, (500, 3)).round(3)
    stage = instancer(np.concatenate([places, [[1e5, 0, 0]]]))
    description, diagnostics = translate(stage, RenderSettings())
    assert distances(description.camera, places).max() == pytest.approx(0, abs=1e-4)
    assert any(d.code == CODE and "left out" in d.message and "/p" in d.message for d in diagnostics)


def test_usdrecord_is_asked_for_by_name() -> None:
    camera = translate_text(KITCHEN, RenderSettings(auto_camera="usdrecord"))[0].camera
    np.testing.assert_allclose(camera.world_from_camera[:3, :3], np.eye(3))
