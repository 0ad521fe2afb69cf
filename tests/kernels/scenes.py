"""Small scenes that together use every feature of the core, for tests that compare its kernels with one another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from tests.described import (
    Described,
    box,
    describe,
    ground,
    image,
    lambert,
    light,
    look_at,
    mesh,
    orthographic,
    perspective,
    placement,
    rotation,
    scaling,
    translation,
)
from tests.images.volumes.voxels import glow, medium, voxels
from tests.textured import plate, primvar, texture, with_primvars

from primray.description import (
    Curves,
    Doubles,
    Hair,
    Interpolation,
    LightType,
    Linked,
    PixelWindow,
    Placed,
    Primvar,
    PrimvarInput,
    Prototype,
    Shadow,
    Shape,
    Sphere,
    Surface,
    TextureFile,
    Wrap,
)
from primray.textures.texture import Texture

RESOLUTION = (37, 23)  # neither whole tiles nor whole packets
ASPECT = RESOLUTION[0] / RESOLUTION[1]
VIEW = look_at([0.3, 1.2, 3.0], [0, 0.3, 0])
GLASS = Surface("/glass", opacity=0.0, roughness=0.0)
THIN = Surface("/thin", opacity=0.3, thin=True, roughness=0.2)
GAP = Surface("/gap", opacity=0.5, presence=True)
COATED = Surface("/coated", diffuse_color=(0.6, 0.1, 0.1), clearcoat=1.0, roughness=0.4)
METAL = Surface("/metal", diffuse_color=(0.9, 0.7, 0.3), metallic=1.0, roughness=0.15)
SURFACES = (lambert((0.7, 0.6, 0.5)), GLASS, THIN, GAP, COATED, METAL, lambert(0.4, emission=0.5))


def all_lights() -> Described:
    above = translation(0.2, 2.0, 0.3) @ rotation([1, 0, 0], -80)
    lights = [
        light(LightType.POINT, translation(1, 1.5, 1)),
        light(LightType.SPHERE, translation(-1, 1.0, 0.5), 3.0, radius=0.2),
        light(LightType.SPHERE, translation(1, 1.0, -0.5) @ scaling(1, 0.3, 0.5), 3.0, radius=0.3),
        light(LightType.DISK, above, radius=0.4),
        light(LightType.RECT, translation(0.5, 0, 0) @ above, 2.0, width=0.5, height=0.3, diffuse=0.5),
        light(LightType.CYLINDER, translation(-0.5, 1.4, 0), 2.0, radius=0.05, length=0.7),
        light(LightType.DISTANT, above, 0.6, angle_deg=5.0),
        light(LightType.DISTANT, above, 0.2),
        light(LightType.DOME, emission=0.3),
    ]
    shapes = [(ground(4), np.eye(4)), (box([0.5, 0.5, 0.5], 4), translation(0, 0.25, 0) @ rotation([0, 1, 0], 30))]
    return describe(shapes, SURFACES, lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION)


def many_lights() -> Described:
    rng = np.random.default_rng(1)
    lights = [light(LightType.SPHERE, translation(*rng.uniform([-2, 0.3, -2], [2, 2, 2])), 2.0, radius=0.1) for _ in range(24)]
    lights.append(light(LightType.DISTANT, rotation([1, 0, 0], -60), 0.3, angle_deg=2.0))
    return describe([(ground(4), np.eye(4))], SURFACES, lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION)


def materials() -> Described:
    shapes: list[tuple[Shape, Doubles]] = [(ground(4), np.eye(4))]
    shapes += [(Sphere(f"/s{i}", 0.3, i), translation(0.7 * (i - 3.5), 0.3, 0.3 * (i % 2))) for i in range(1, 7)]
    shapes += [(box([0.4, 0.8, 0.05], 2), translation(-0.5, 0.4, 1.0)), (box([0.4, 0.8, 0.05], 3), translation(0.5, 0.4, 1.0))]
    texture = np.random.default_rng(2).random((8, 16, 3)) ** 4 * 3
    lights = [
        light(LightType.DOME, rotation([0, 1, 0], 40)),
        light(LightType.RECT, translation(0, 2, 0) @ rotation([1, 0, 0], -90)),
    ]
    return describe(shapes, SURFACES, lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION, dome_texture=texture)


def through_a_camera() -> Described:
    """Everything that a camera can have: blades, planes that clip, an open shutter, a window that reaches beyond the frame."""
    scene = materials()
    planes = ((0.3, 1.0, 0.2, 1.0), (0.0, 0.0, 1.0, 4.5))
    eye = replace(
        scene.description.camera,
        lens_radius=0.05,
        focus_distance=3.0,
        blades=5,
        blade_rotation_deg=20.0,
        clipping_planes=planes,
        shutter=(-0.2, 0.3),
    )
    pixels = PixelWindow(-7, -3, RESOLUTION[0] + 9, RESOLUTION[1] + 2)
    return replace(scene, description=replace(scene.description, camera=eye, pixels=pixels))


def instances() -> Described:
    rng = np.random.default_rng(3)
    matrices = [
        translation(*rng.uniform([-1.5, 0, -1.5], [1.5, 1, 1.5])) @ rotation(rng.normal(size=3), 360 * rng.random())
        for _ in range(40)
    ]
    matrices = [m @ scaling(*rng.uniform(0.3, 1.5, 3) * [1 if i % 3 else -1, 1, 1]) for i, m in enumerate(matrices)]
    prototypes = [
        Prototype("/p", (Placed(1, np.eye(4)), Placed(2, translation(0, 0.15, 0)))),
        Prototype("/q", (Placed(2, scaling(1, 2, 1)),)),
    ]
    placements = [placement(0, matrices[:25]), placement(1, matrices[25:])]
    lights = [light(LightType.RECT, translation(0, 2.5, 0) @ rotation([1, 0, 0], -90), 4.0, width=1.0, height=1.0)]
    return describe(
        [(ground(4), np.eye(4))], SURFACES, lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION,
        prototypes, [box([0.2, 0.2, 0.2], 5), Sphere("/s", 0.1, 4)], placements,
    )  # fmt: skip


def grouped(flat: bool = False) -> Described:
    """Instances of instances, kept in two levels or multiplied out; mirrored, sheared, with smooth normals and spheres."""
    rng = np.random.default_rng(6)

    def scattered(count: int, spread: float, size: float) -> Doubles:
        at = [
            translation(*rng.uniform(-spread, spread, 3)) @ rotation(rng.normal(size=3), 360 * rng.random())
            for _ in range(count)
        ]
        return np.array([m @ scaling(*size * rng.uniform(0.5, 1.5, 3) * [1 if i % 3 else -1, 1, 1]) for i, m in enumerate(at)])

    points = np.array([[0, 0.1, 0], [0.1, -0.1, 0.1], [-0.1, -0.1, 0.1], [0, -0.1, -0.1]])
    tetrahedron = mesh(
        points, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], 4, normals=points / np.linalg.norm(points, axis=1)[:, None]
    )
    boxes, balls, outer, alone = (
        scattered(10, 0.4, 0.7),
        scattered(5, 0.4, 0.7),
        scattered(12, 1.2, 0.8),
        scattered(4, 1.0, 1.0),
    )
    prototypes = [
        Prototype("/p", (Placed(1, np.eye(4)), Placed(2, translation(0, 0.15, 0)))),
        Prototype("/q", (Placed(2, scaling(1, 2, 1)), Placed(3, translation(0.2, 0, 0)))),
    ]
    if flat:
        products = [(outer[:, None] @ inner[None]).reshape(-1, 4, 4) for inner in (boxes, balls)]
        placements = [placement(0, products[0]), placement(1, products[1]), placement(0, alone)]
    else:
        prototypes.append(Prototype("/both", (), (placement(0, boxes), placement(1, balls))))
        placements = [placement(2, outer[:5]), placement(0, alone), placement(2, outer[5:])]
    lights = [light(LightType.RECT, translation(0, 2.5, 0) @ rotation([1, 0, 0], -90), 4.0, width=1.0, height=1.0)]
    return describe(
        [(ground(4), np.eye(4))], SURFACES, lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION,
        prototypes, [box([0.2, 0.2, 0.2], 5), Sphere("/s", 0.1, 2), tetrahedron], placements,
    )  # fmt: skip


def smooth() -> Described:
    """Normals and colours by point, by corner, by triangle."""
    n = 12
    u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    theta, phi = 0.1 + 2.9 * u, 2 * np.pi * v
    p = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1).reshape(-1, 3)
    at = np.arange(n * n).reshape(n, n)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    white = (lambert(1.0), *SURFACES[1:])
    rng = np.random.default_rng(4)
    by_point = mesh(0.4 * p, triangles, 0, normals=p, colors=rng.random((len(p), 3)))
    by_corner = mesh(0.4 * p, triangles, 0, normals=p[triangles].reshape(-1, 3), colors=rng.random((3 * len(triangles), 3)))
    by_triangle = mesh(0.4 * p, triangles, 0, colors=rng.random((len(triangles), 3)))
    shapes = [
        (by_point, translation(-1, 0.4, 0)),
        (by_corner, translation(0, 0.4, 0) @ scaling(-1, 1, 0.7)),
        (by_triangle, translation(1, 0.4, 0)),
    ]
    lights = [light(LightType.POINT, translation(1, 2, 2), 4.0), light(LightType.DOME, emission=0.5)]
    return describe(shapes, white, lights, perspective(VIEW, 0.4, ASPECT, lens_radius=0.05, focus_distance=3.0), RESOLUTION)


def from_above() -> Described:
    camera = orthographic(look_at([0, 3, 0], [0, 0, 0], up=(0, 0, -1)), 1.5, ASPECT)
    lights = [light(LightType.SPHERE, translation(0.5, 1, 0.5), 5.0, radius=0.1)]
    return describe([(ground(4), np.eye(4)), (box([1, 1, 1], 5), translation(0, 0.2, 0))], SURFACES, lights, camera, RESOLUTION)


def emitters() -> Described:
    """Geometry that emits: static, instanced, mirrored, spheres, triangles of two surfaces; beside a light."""
    lamp, dim = lambert(0.2, emission=3.0), lambert(0.5, emission=0.2)
    two = replace(box([0.3, 0.3, 0.3]), surface=np.array([1, 2] * 6, np.int32))
    rows = np.array(
        [m[:3] for m in (translation(-1, 1, 0), translation(1, 1.2, 0.4) @ scaling(-1, 0.5, 1), scaling(0.2, 0.2, 2))]
    )
    shapes: list[tuple[Shape, Doubles]] = [
        (ground(4), np.eye(4)),
        (two, translation(0, 0.5, 0)),
        (Sphere("/s", 0.2, 1), translation(0.6, 0.3, 0.8) @ scaling(1, 2, 0.5)),
    ]
    prototype = Prototype("/p", (Placed(3, np.eye(4)), Placed(4, translation(0, 0.5, 0)), Placed(5, translation(0, -0.3, 0))))
    members: list[Shape] = [box([0.2, 0.1, 0.3], 1), Sphere("/q", 0.1, 1), box([0.1, 0.1, 0.1], 0)]
    lights = [light(LightType.POINT, translation(0, 2, 1), 0.5)]
    return describe(
        shapes, (lambert(0.7), lamp, dim), lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION, [prototype], members,
        [placement(0, rows)],
    )  # fmt: skip


COLORS, NUMBERS, LEAF = TextureFile("colors", "raw"), TextureFile("numbers", "raw"), TextureFile("leaf", "raw")
TILES = TextureFile("tiles.<UDIM>", "raw")


def textured() -> Described:
    """Every input from a texture or a primvar, normal maps, tiles, cut-outs, see-through textures, on meshes and instances."""
    rng = np.random.default_rng(5)
    colors = rng.random((33, 20, 3)) ** 2
    bumps = np.concatenate([rng.uniform(-0.5, 0.5, (16, 16, 2)), np.ones((16, 16, 1))], axis=2)
    leaf = (rng.random((9, 9, 2)) > 0.4) * 1.0
    tiles = [(number, Texture(rng.random((4, 4, 3)).astype(np.float32))) for number in (1001, 1002, 1012)]
    tint = PrimvarInput("tint", (0.3, 0.6, 0.9))
    surfaces = [
        Surface("/all", inputs=(
            ("diffuse_color", texture(file=COLORS, wrap=Wrap.REPEAT)), ("roughness", texture("g", COLORS, Wrap.MIRROR)),
            ("metallic", texture("b", COLORS)), ("clearcoat", PrimvarInput("tint", (0.5,))), ("normal", texture(file=NUMBERS)),
        )),
        Surface("/leaf", opacity_threshold=0.5, inputs=(("opacity", texture("a", LEAF)), ("diffuse_color", tint))),
        Surface("/veil", thin=True, inputs=(("opacity", texture("r", COLORS)), ("diffuse_color", texture(file=TILES)))),
        Surface("/gap", presence=True, inputs=(("opacity", texture("g", COLORS, Wrap.BLACK)),)),
        Surface("/glow", lambert=True, inputs=(("emissive_color", texture(file=COLORS, scale=(2, 1, 1, 1))),)),
        *SURFACES[:2],
    ]  # fmt: skip
    wide = [[0, 0], [4, 0], [4, 4], [0, 4]]

    def standing(surface: int, x: float, st: list[list[float]], *, half: float = 0.4) -> tuple[Shape, Doubles]:
        mesh = with_primvars(plate(st, half, surface), primvar("tint", [[0.9, 0.8, 0.1], [0.1, 0.2, 0.3]], Interpolation.FACE))
        return mesh, translation(x, 0.4, 0.4 * np.cos(5 * x)) @ rotation([0, 1, 0], 40 * x)

    one, two = ([[0.0, 0.0], [n, 0.0], [n, n], [0.0, n]] for n in (1.0, 2.0))
    floor = with_primvars(ground(4), primvar("st", wide))
    shapes = [
        (floor, np.eye(4)),
        *(standing(k, 0.8 * (k - 2), two if k == 2 else one) for k in range(5)),
    ]
    shapes.append((Sphere("/s", 0.3, 0), translation(0.2, 1.0, 0.2)))
    mixed = with_primvars(box([0.3, 0.3, 0.3]), primvar("st", rng.random((8, 2))))
    mixed = replace(mixed, surface=np.arange(len(mixed.triangles), dtype=np.int32) % 7)
    places = [
        translation(*rng.uniform([-1.5, 0, -1], [1.5, 1, 1])) @ rotation(rng.normal(size=3), 360 * rng.random())
        for _ in range(12)
    ]
    matrices = np.array([(m @ scaling(-1 if i % 2 else 1, 1, 0.7))[:3] for i, m in enumerate(places)])
    placements = [
        placement(0, matrices[:6], (primvar("tint", rng.random((6, 3)), Interpolation.INSTANCE),)),
        placement(0, matrices[6:]),
    ]
    lights = [
        light(LightType.RECT, translation(0, 2.5, 0) @ rotation([1, 0, 0], -90), 3.0),
        light(LightType.DOME, emission=0.3),
    ]
    textures = {COLORS: image(colors), NUMBERS: image(bumps), LEAF: image(leaf), TILES: tiles}
    return describe(
        shapes, surfaces, lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION,
        [Prototype("/p", (Placed(len(shapes), np.eye(4)),))], [mixed], placements, textures=textures,
    )  # fmt: skip


def strands(count: int, surface: int, seed: int) -> Curves:
    """Bent ones of two segments each, with ends, joints and a colour for each of their parts."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(scale=0.06, size=(count, 7, 3)) + (0, 0.07, 0)
    points = np.cumsum(steps, axis=1) + rng.uniform([-1, 0, -0.5], [1, 0.1, 0.5], (count, 1, 3))
    radii = np.repeat(np.linspace(0.04, 0.005, 7)[None, :, None], count, axis=0)
    controls = np.concatenate([points, radii], axis=2).reshape(-1, 4).astype(np.float32)
    segments = np.full(count, 2, np.int32)
    colors = tuple(
        Primvar(name, kind, rng.random((rows * count, 3)).astype(np.float32))
        for name, kind, rows in (
            ("a", Interpolation.POINT, 7),
            ("b", Interpolation.CORNER, 3),
            ("c", Interpolation.FACE, 1),
        )
    )
    return Curves(f"/hair{seed}", controls, segments, surface, primvars=colors)


def hairs() -> Described:
    """Tubes: in the world and in instances, round and elliptic, of colours that vary."""
    colored = [Surface(f"/{n}", lambert=True, inputs=(("diffuse_color", PrimvarInput(n, (0.5,) * 3)),)) for n in "abc"]
    shapes: list[tuple[Shape, Doubles]] = [(ground(4), np.eye(4)), (box([0.3, 0.3, 0.3], 3), translation(-0.8, 0.2, -0.5))]
    shapes += [(strands(20, k, k), translation(0.6 * (k - 1), 0, 0.3 * k)) for k in range(3)]
    shapes.append((strands(8, 0, 3), translation(0, 0, 0.8) @ scaling(1, 1.5, 0.6)))
    matrices = [translation(0.7 * k - 1, 0.1, 0.9) @ rotation([0, 1, 0], 50 * k) @ scaling(0.7, 0.7, 0.7) for k in range(4)]
    lights = [
        light(LightType.RECT, translation(0, 2.5, 0) @ rotation([1, 0, 0], -90), 4.0),
        light(LightType.DOME, emission=0.3),
    ]
    return describe(
        shapes, [*colored, METAL], lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION,
        [Prototype("/p", (Placed(len(shapes), np.eye(4)),))], [strands(5, 1, 4)], [placement(0, matrices)],
    )  # fmt: skip


def furs() -> Described:
    """Hair beside tubes of another surface, in the world and in instances."""
    surfaces = [Surface("/fur", hair=Hair(absorption=(0.1, 0.3, 0.8))), lambert(0.7)]
    shapes: list[tuple[Shape, Doubles]] = [(ground(4, surface=1), np.eye(4))]
    shapes += [(strands(30, k % 2, k), translation(0.5 * (k - 1), 0, 0.3 * k)) for k in range(3)]
    matrices = [translation(0.7 * k - 1, 0.1, 0.9) @ rotation([0, 1, 0], 50 * k) for k in range(3)]
    lights = [
        light(LightType.RECT, translation(0, 2.5, 0) @ rotation([1, 0, 0], -90), 4.0),
        light(LightType.DOME, emission=0.3),
    ]
    return describe(
        shapes, surfaces, lights, perspective(VIEW, 0.4, ASPECT), RESOLUTION,
        [Prototype("/p", (Placed(len(shapes), np.eye(4)),))], [strands(8, 0, 4)], [placement(0, matrices)],
    )  # fmt: skip


def linked() -> Described:
    """Light and shadow linking, shadows of every kind, lights that the camera does not see, through panes and instances."""
    d = instances()
    rng = np.random.default_rng(7)
    members = np.concatenate([np.ones((1, 5)), np.concatenate([np.ones((3, 1)), rng.random((3, 4)) > 0.4], axis=1)]) > 0
    above = translation(0.2, 2.0, 0.3) @ rotation([1, 0, 0], -80)
    lights = [
        light(LightType.POINT, translation(1, 1.5, 1), light_link=1),
        light(LightType.SPHERE, translation(-1, 1.0, 0.5), 3.0, radius=0.2, shadow_link=2, visible_to_camera=False),
        light(LightType.RECT, above, 2.0, width=0.5, height=0.3, light_link=2, shadow=Shadow(color=(0.3, 0.1, 0.0))),
        light(LightType.CYLINDER, translation(-0.5, 1.4, 0), 2.0, radius=0.05, length=0.7, light_link=3),
        light(LightType.DISK, above, radius=0.4, shadow=Shadow(distance=0.8, falloff=0.5, falloff_gamma=2.2), light_link=4),
        light(LightType.DISTANT, above, 0.6, angle_deg=5.0, shadow=Shadow(enabled=False), light_link=1),
        light(LightType.DOME, emission=0.3, light_link=4, shadow_link=3, visible_to_camera=False),
        light(LightType.DOME, emission=0.1, light_link=2),
    ]
    shapes = tuple(replace(s, link_row=k) for k, s in enumerate(d.description.shapes))
    panes: tuple[Shape, ...] = (replace(box([0.4, 0.8, 0.05], 2), link_row=3), replace(box([0.4, 0.8, 0.05], 3), link_row=1))
    placed = tuple(Placed(len(shapes) + k, translation(k - 0.5, 0.4, 1.0)) for k in range(2))
    description = replace(
        d.description, shapes=shapes + panes, static=d.description.static + placed, lights=tuple(lights),
        linked=Linked(("/a", "/b", "/c", "/d"), members),
    )  # fmt: skip
    return replace(d, description=description)


def linked_crowd() -> Described:
    """More lights than are weighed one by one."""
    d = linked()
    rng = np.random.default_rng(8)
    more = [
        light(LightType.SPHERE, translation(*rng.uniform([-2, 0.3, -2], [2, 2, 2])), 1.0, radius=0.1, light_link=k % 5)
        for k in range(24)
    ]
    return replace(d, description=replace(d.description, lights=(*d.description.lights, *more)))


def volumes() -> Described:
    """Smoke and fire in grids that overlap, around and within bodies, in lights of all kinds."""
    d = all_lights()
    rng = np.random.default_rng(3)
    near = translation(-0.5, -0.2, -0.5) @ scaling(0.08, 0.08, 0.08)
    cloud = voxels(rng.random((16, 16, 16)) ** 3)
    gray = medium(cloud, 2.0, 0.9, anisotropy=0.5, matrices=[near, near @ rotation([1, 1, 0], 30)])
    tint = voxels(rng.random((16, 16, 16, 3)), half=True)
    colored = medium(voxels(rng.random((16, 16, 16)), half=True), (1.0, 2.0, 0.5), 0.8, albedo_grid=tint, matrices=[near])
    fire = [glow(tint, 0.5, matrices=[near]), glow(cloud, (1.0, 0.5, 0.2), matrices=[translation(0, 0.2, 0) @ near])]
    description = replace(d.description, media=(gray, colored), volume_emissions=tuple(fire))
    return replace(d, description=description)


def crowd_of_volumes() -> Described:
    """More instances of smoke and fire than are tested one by one."""
    d = volumes()
    rng = np.random.default_rng(4)
    places = np.array([translation(*rng.uniform(-1.5, 1.5, 3)) @ scaling(0.03, 0.04, 0.03) for _ in range(30)])
    description = replace(
        d.description,
        media=tuple(replace(m, matrices=places[k::2]) for k, m in enumerate(d.description.media)),
        volume_emissions=tuple(replace(m, matrices=places) for m in d.description.volume_emissions),
    )
    return replace(d, description=description)


SCENES: dict[str, Callable[[], Described]] = {
    "all lights": all_lights,
    "many lights": many_lights,
    "materials": materials,
    "instances": instances,
    "grouped": grouped,
    "smooth, lens": smooth,
    "orthographic": from_above,
    "blades, planes, shutter": through_a_camera,
    "emitters": emitters,
    "textures": textured,
    "hairs": hairs,
    "furs": furs,
    "linked": linked,
    "linked crowd": linked_crowd,
    "volumes": volumes,
    "crowd of volumes": crowd_of_volumes,
}
