"""What is inside closed bodies, in closed form: from a stage's MaterialX nodes to pixels."""

from __future__ import annotations

import math
import random
import time
from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray

Inputs = dict[str, Any]
THIN_AIR: Inputs = {"base_weight": 0.0, "specular_weight": 0.0, "transmission_weight": 1.0}  # a boundary without reflection
GLASS: Inputs = {"base_weight": 0.0, "transmission_weight": 1.0, "specular_roughness": 0.0}
TYPES = {bool: "bool", float: "float", tuple: "color3f"}
COLOR = (0.5, 0.25, 0.8)
E = math.exp(-1)
SKY = 'def DomeLight "sky" { color3f inputs:color = (1, 1, 1)\n}\n'
SUN = """def DistantLight "sun" { float inputs:angle = 0.1
    float inputs:intensity = 1
    bool inputs:normalize = 1
    float3 xformOp:rotateXYZ = (-60, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""
SUN_COSINE = 0.5


def material(name: str, inputs: Inputs, priority: float | None = None) -> str:
    lines = "\n".join(f"        {TYPES[type(v)]} inputs:{k} = {str(v).lower()}" for k, v in inputs.items())
    first = "" if priority is None else f"    float primray:dielectric:priority = {priority}\n"
    return f"""def Material "{name}" {{
{first}    token outputs:mtlx:surface.connect = </{name}/surface.outputs:out>
    def Shader "surface" {{
        uniform token info:id = "ND_open_pbr_surface_surfaceshader"
        token outputs:out
{lines}
    }}
}}
"""


def box(size: tuple[float, float, float], z: float = 0.0, wears: str = "m", name: str = "box") -> str:
    return f"""def Cube "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    double size = 1
    double3 xformOp:translate = (0, 0, {z})
    double3 xformOp:scale = {size}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    rel material:binding = </{wears}>
}}
"""


def ball(radius: float, wears: str = "m", name: str = "ball", centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    return f"""def Sphere "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    double radius = {radius}
    double3 xformOp:translate = {centre}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </{wears}>
}}
"""


def seen(*parts: str, aperture: float = 1.0, **settings: Any) -> np.ndarray:
    """The mean colour before an orthographic camera at z = 40 that looks down; `aperture` in tenths of units."""
    camera = f"""#usda 1.0
( metersPerUnit = 1
  upAxis = "Y" )
def Camera "eye" {{
    token projection = "orthographic"
    float horizontalAperture = {aperture}
    float verticalAperture = {aperture}
    double3 xformOp:translate = (0, 0, 40)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(camera + "".join(parts))
    image = primray.render(stage, **{"resolution": (8, 8), "spp": 512, **settings})
    return np.asarray(image.pixels[..., :3], float).mean((0, 1))


def filled(color: tuple[float, ...] = COLOR, depth: float = 1.0, scatter: float = 0.0, g: float = 0.0, **more: Any) -> Inputs:
    inside = {"transmission_color": color, "transmission_depth": depth, "transmission_scatter": (scatter,) * 3}
    return {**THIN_AIR, **inside, "transmission_scatter_anisotropy": g, **more}


def chandrasekhar_h(mu: float, albedo: float) -> float:
    """Of isotropic scattering in a half-space (Chandrasekhar 1950, "Radiative Transfer"), by iteration over Gauss points."""
    x, w = np.polynomial.legendre.leggauss(200)
    x, w = (x + 1) / 2, w / 2
    h = np.ones(200)

    def at(m: np.ndarray) -> np.ndarray:
        return 1 / (math.sqrt(1 - albedo) + albedo / 2 * (w * x * h / (m[:, None] + x)).sum(1))

    for _ in range(500):
        h = at(x)
    return float(at(np.array([mu]))[0])


def test_a_slab_absorbs_by_beers_law() -> None:
    slab = box((100, 100, 2))
    np.testing.assert_allclose(seen(slab, material("m", filled()), SKY, spp=16), np.square(COLOR), rtol=1e-5)
    np.testing.assert_allclose(seen(slab, material("m", filled(depth=4.0)), SKY, spp=16), np.sqrt(COLOR), rtol=1e-5)


def test_between_reflecting_boundaries_it_does_so_on_every_way() -> None:
    f, t = 0.04, np.square(COLOR)
    passed = (1 - f) ** 2 * t / (1 - (f * t) ** 2)
    found = seen(box((100, 100, 2)), material("m", filled(**GLASS, specular_weight=1.0)), SKY, spp=1024)
    np.testing.assert_allclose(found, passed + f + f * passed * t, rtol=3e-3)


def test_far_and_small_worlds_absorb_the_same() -> None:
    for size in (1e-3, 1e5):
        slab = box((50 * size, 50 * size, 2 * size), z=30.0 - size)
        found = seen(slab, material("m", filled(depth=size)), SKY, spp=16, aperture=1e-3)
        np.testing.assert_allclose(found, np.square(COLOR), rtol=1e-3)


def test_what_loses_nothing_is_as_white_as_the_sky() -> None:
    white = filled((0.3, 0.5, 0.7), 1.0)
    white["transmission_scatter"] = tuple(-math.log(c) for c in (0.3, 0.5, 0.7))
    for surface in (THIN_AIR, {**GLASS, "specular_weight": 1.0}, {**GLASS, "specular_weight": 1.0, "specular_roughness": 0.2}):
        tolerance = 4e-3 if surface.get("specular_roughness") != 0.2 else 1.5e-2  # rough glass itself: see test_furnace.py
        found = seen(ball(5.0), material("m", {**white, **surface}), SKY, spp=4096)
        np.testing.assert_allclose(found, 1.0, atol=tolerance)


@pytest.mark.parametrize("albedo", [0.5, 0.9, 0.99])
def test_a_half_space_reflects_a_white_sky_by_chandrasekhars_function(albedo: float) -> None:
    deep = box((4000, 4000, 300), z=-150)
    found = seen(deep, material("m", filled((E, E, E), 1.0, albedo)), SKY, spp=4096)
    np.testing.assert_allclose(found, 1 - chandrasekhar_h(1.0, albedo) * math.sqrt(1 - albedo), rtol=5e-3)


def test_a_half_space_in_the_sun_reflects_by_two_of_them() -> None:
    found = seen(box((4000, 4000, 300), z=-150), material("m", filled((E, E, E), 1.0, 0.9)), SUN, spp=8192)
    h = chandrasekhar_h(1.0, 0.9) * chandrasekhar_h(SUN_COSINE, 0.9)
    np.testing.assert_allclose(found, 0.9 / (4 * math.pi) * SUN_COSINE / (1 + SUN_COSINE) * h, rtol=1e-2)


@pytest.mark.parametrize("g", [0.0, 0.5, -0.5])
def test_light_that_scatters_once_in_a_slab(g: float) -> None:
    small = 0.002
    found = seen(box((4000, 4000, 2)), material("m", filled((E, E, E), 1.0, small, g)), SUN, spp=4096)
    phase = (1 - g * g) / (4 * math.pi * (1 + g * g + 2 * g * SUN_COSINE) ** 1.5)
    once = small * phase * SUN_COSINE / (1 + SUN_COSINE) * (1 - math.exp(-2 * (1 + 1 / SUN_COSINE)))
    np.testing.assert_allclose(found, once, rtol=1e-2)


def test_shadows_of_clear_bodies_are_coloured() -> None:
    floor = """def Mesh "floor" { point3f[] points = [(-5e3, -5e3, -30), (5e3, -5e3, -30), (5e3, 5e3, -30), (-5e3, 5e3, -30)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
"""
    found = seen(box((4000, 4000, 2)), floor, material("m", filled()), SUN, spp=64)
    both_ways = np.power(COLOR, 2 + 2 / SUN_COSINE)
    np.testing.assert_allclose(found, 0.5 / math.pi * SUN_COSINE * both_ways, rtol=2e-3)


def test_a_camera_and_lights_inside_see_through_the_medium() -> None:
    wall = """def RectLight "wall" { float inputs:width = 1000
    float inputs:height = 1000
    double3 xformOp:translate = (0, 0, -20)
    float3 xformOp:rotateXYZ = (0, 180, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""
    for surface in (THIN_AIR, {**GLASS, "specular_weight": 1.0}):
        water = material("m", {**filled(depth=40.0), **surface})
        np.testing.assert_allclose(seen(box((5000, 5000, 500)), water, wall, spp=4), np.power(COLOR, 60 / 40), rtol=1e-4)


@pytest.mark.parametrize("surface", [THIN_AIR, {**GLASS, "specular_weight": 1.0}], ids=["matched", "glass"])
def test_all_light_of_a_lamp_comes_out_of_what_loses_none(surface: Inputs) -> None:
    lamp = 'def SphereLight "lamp" { float inputs:radius = 0.5\n    float inputs:intensity = 100\n}\n'
    milk = material("m", {**filled((E, E, E), 2.0, 1.0), **surface})
    found = seen(ball(5.0), milk, lamp, aperture=140.0, resolution=(28, 28), spp=512)
    np.testing.assert_allclose(found, math.pi * 0.5**2 * 100 / 14**2, rtol=2e-2)


def test_a_lamp_below_a_surface_is_seen_through_what_is_above_it() -> None:
    """Where two channels do not scatter, by Beer's law along the rays of a white Lambert surface that meet the lamp."""
    lamp = 'def SphereLight "lamp" { float inputs:radius = 2\n    float inputs:intensity = 1\n}\n'
    inputs = {"specular_weight": 0.0, "subsurface_weight": 1.0, "subsurface_color": (0.0, 0.0, 0.3), "subsurface_radius": 4.0}
    wax = material("m", {**inputs, "subsurface_radius_scale": (1.0, 0.3, 0.6)})
    x, w = np.polynomial.legendre.leggauss(200)
    widest = math.asin(2 / 5)
    t, w = (x + 1) / 2 * widest, w / 2 * widest
    way = 5 * np.cos(t) - np.sqrt(4 - np.square(5 * np.sin(t)))
    expected = [float(2 * (w * np.exp(-way / path) * np.cos(t) * np.sin(t)).sum()) for path in (4.0, 1.2)]
    np.testing.assert_allclose(seen(ball(5.0), wax, lamp, spp=8192, aperture=0.1)[:2], expected, rtol=1.5e-2)


@pytest.mark.parametrize("g", [0.0, 0.7])
def test_subsurface_has_its_colour_whatever_its_phase(g: float) -> None:
    inputs = {"specular_weight": 0.0, "subsurface_weight": 1.0, "subsurface_color": (0.2, 0.5, 0.8), "subsurface_radius": 0.1}
    below = material("m", {**inputs, "subsurface_scatter_anisotropy": g})
    np.testing.assert_allclose(seen(box((200, 200, 50)), below, SKY, spp=2048), (0.2, 0.5, 0.8), atol=5e-3)  # the formula's own


def test_subsurface_is_a_mixture_below_the_specular_lobe() -> None:
    inputs = {
        "specular_roughness": 0.0,
        "subsurface_weight": 0.5,
        "subsurface_color": (0.2, 0.5, 0.8),
        "base_color": (0.6, 0.4, 0.2),
    }
    found = seen(box((200, 200, 50)), material("m", {**inputs, "subsurface_radius": 0.1}), SKY, spp=2048)
    np.testing.assert_allclose(found, 0.04 + 0.96 * np.array((0.4, 0.45, 0.5)), rtol=1e-2)


def test_white_wax_is_as_white_as_the_sky_at_any_radius() -> None:
    for radius in (10.0, 0.5, 0.02):
        inputs = {
            "specular_weight": 0.0,
            "subsurface_weight": 1.0,
            "subsurface_color": (1.0, 1.0, 1.0),
            "subsurface_radius": radius,
        }
        np.testing.assert_allclose(seen(ball(5.0), material("m", inputs), SKY, spp=512), 1.0, atol=5e-3)


def test_a_channel_without_a_radius_walks_as_others_do() -> None:
    inputs = {"specular_weight": 0.0, "subsurface_weight": 1.0, "subsurface_color": (1.0, 1.0, 1.0), "subsurface_radius": 0.5}
    below = material("m", {**inputs, "subsurface_radius_scale": (1.0, 0.5, 0.0)})
    began = time.process_time()
    np.testing.assert_allclose(seen(ball(5.0), below, SKY, spp=256), 1.0, atol=1e-2)
    assert time.process_time() - began < 30


def test_a_radius_of_nothing_is_a_diffuse_surface() -> None:
    """It has the albedo of the walk, which the formula from colours to media gives within 5e-3."""
    inputs = {"specular_weight": 0.0, "subsurface_weight": 1.0, "subsurface_color": COLOR}
    for radius in (0.0, 1e-9):
        below = material("m", {**inputs, "subsurface_radius": radius})
        np.testing.assert_allclose(seen(box((200, 200, 50)), below, SKY, spp=256), COLOR, atol=5e-3)


def test_a_body_in_another_meets_its_index() -> None:
    """A ball of the surrounding glass's index is not seen; one of another index reflects by their ratio."""
    outer, glass = box((100, 100, 10), wears="a"), material("a", {**GLASS, "specular_ior": 1.5})
    around = seen(outer, glass, SKY, spp=1024)
    same = seen(outer, ball(3.0, "b"), glass, material("b", {**GLASS, "specular_ior": 1.5}), SKY, spp=1024)
    np.testing.assert_allclose(same, around, rtol=2e-3)
    lamp = """def RectLight "lamp" { float inputs:width = 4
    float inputs:height = 4
    double3 xformOp:translate = (0, 0, 60)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    slab = box((99, 99, 4), z=1.0, wears="b", name="inner")
    bright = seen(outer, slab, glass, material("b", {**GLASS, "specular_ior": 3.0}), lamp, spp=4096, aperture=0.1)
    f1, f2 = 0.04, (1 / 3) ** 2  # of 3 in 1.5: as of 2 in air
    inner = f2 + (1 - f2) ** 2 * f2 / (1 - f2**2)
    series = inner + (1 - inner) ** 2 * f1 / (1 - inner * f1)  # with the far wall
    np.testing.assert_allclose(bright, f1 + (1 - f1) ** 2 * series / (1 - f1 * series), rtol=3e-2)


@pytest.mark.parametrize(("priorities", "shown"), [((1.0, 0.0), 0), ((0.0, 1.0), 1)])
def test_where_bodies_overlap_the_one_of_higher_priority_is_there(priorities: tuple[float, float], shown: int) -> None:
    """Two slabs of 4 overlap by 2: all of one, and what the other has left."""
    colors = ((0.9, 0.5, 0.5), (0.5, 0.5, 0.9))
    parts = [box((100, 100, 4), z=z, wears=n, name=f"box_{n}") for n, z in (("a", 1.0), ("b", -1.0))]
    parts += [material(n, filled(c, 2.0), p) for n, c, p in zip("ab", colors, priorities, strict=True)]
    whole, rest = np.array(colors[shown]), np.array(colors[1 - shown])
    np.testing.assert_allclose(seen(*parts, SKY, spp=16), whole**2 * rest, rtol=1e-4)


def test_walls_of_one_mesh_may_wear_several_materials() -> None:
    """Light comes in by one and goes out by another, and is outside then."""
    points = [(x, y, z) for z in (-1, 1) for y in (-50, 50) for x in (-50, 50)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh = f"""def Mesh "slab" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    point3f[] points = {points}
    int[] faceVertexCounts = {[4] * 6}
    int[] faceVertexIndices = {[i for f in faces for i in f]}
    uniform token subdivisionScheme = "none"
    rel material:binding = </a>
    def GeomSubset "below" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [0]
        rel material:binding = </b>
    }}
}}
"""
    floor = box((300, 300, 1), z=-30.0, wears="c", name="floor")
    white = material("c", {"specular_weight": 0.0, "base_color": (1.0, 1.0, 1.0)})
    found = seen(mesh, floor, material("a", filled()), material("b", filled(depth=3.0)), white, SKY, spp=2048)
    # The floor is lit through the slab, and around it: between Beer's law both ways and once.
    assert (found > np.power(COLOR, 4.5)).all()
    assert (found < np.square(COLOR)).all()
    bare = seen(mesh, material("a", filled()), material("b", filled(depth=3.0)), SKY, spp=16)
    np.testing.assert_allclose(bare, np.square(COLOR), rtol=1e-4)


def test_an_open_mesh_has_no_interior_and_says_so() -> None:
    sheet = """def Mesh "sheet" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    point3f[] points = [(-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    rel material:binding = </m>
}
"""
    with pytest.warns(primray.RenderWarning, match="open-interior"):
        np.testing.assert_allclose(seen(sheet, material("m", filled()), SKY, spp=16), COLOR, rtol=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_the_strangest_interiors_are_finite_and_end(seed: int) -> None:
    rng = random.Random(seed)
    numbers = (0.0, 1e-30, 1e-6, 0.5, 1.0, 1e6, 1e30)

    def some() -> tuple[float, ...]:
        return tuple(rng.choice(numbers) for _ in range(3))

    inside = {"transmission_depth": rng.choice(numbers), "transmission_scatter": some(), "transmission_color": some()}
    below = {"subsurface_weight": 1.0, "subsurface_radius": rng.choice(numbers), "subsurface_radius_scale": some()}
    phases = {
        "transmission_scatter_anisotropy": rng.choice((-1.0, 1.0)),
        "subsurface_scatter_anisotropy": rng.choice((-1.0, 1.0)),
    }
    inputs = {
        **inside,
        **below,
        **phases,
        "transmission_weight": rng.choice((0.0, 0.5, 1.0)),
        "specular_weight": rng.choice((0.0, 1.0)),
    }
    assert np.isfinite(seen(ball(5.0), material("m", inputs), SKY, spp=2)).all()
