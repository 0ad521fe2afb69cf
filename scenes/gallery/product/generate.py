"""Writes scene.usda and geometry.usdc: a wristwatch between softboxes. Made for primray; Apache-2.0.

python -m scenes.gallery.product.generate
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, UsdGeom
from scenes.gallery.making import Scene, joined, lathe, smoothed, turned_body

TYPES = Sdf.ValueTypeNames
TAU = 2 * np.pi

scene = Scene(__file__, "A wristwatch between softboxes: brushed and polished steel, a sunburst dial, leather, velvet.")
scene.camera(eye=(0.0, 0.052, 0.36), at=(0.016, 0.0325, 0.0), focal_length=84, f_stop=8, focus=(-0.002, 0.035, 0.035))

# Grooves go along tangents, which meshes give by st.
scene.material(
    "brushed", base_color=(0.62, 0.6, 0.58), base_metalness=1.0, specular_roughness=0.32, specular_roughness_anisotropy=0.75
)
scene.material("polished", base_color=(0.72, 0.7, 0.68), base_metalness=1.0, specular_roughness=0.09)
scene.material("gold", base_color=(0.95, 0.68, 0.42), base_metalness=1.0, specular_roughness=0.14)
scene.material(
    "dial",
    base_color=(0.03, 0.12, 0.2),
    base_metalness=1.0,
    specular_roughness=0.42,
    specular_roughness_anisotropy=0.85,
    coat_weight=1.0,
    coat_roughness=0.12,
    coat_color=(0.75, 0.9, 1.0),
)
scene.material(
    "subdial", base_color=(0.05, 0.1, 0.14), base_metalness=1.0, specular_roughness=0.3, specular_roughness_anisotropy=0.8
)
scene.material("print", base_color=(0.85, 0.83, 0.78), specular_roughness=0.6)
scene.material(
    "crystal",
    transmission_weight=1.0,
    specular_roughness=0.0,
    specular_ior=1.6,
    geometry_thin_walled=True,
    thin_film_weight=1.0,
    thin_film_thickness=0.11,
    thin_film_ior=1.38,
)
scene.material(
    "leather",
    base_color=(0.4, 0.17, 0.07),
    specular_roughness=0.5,
    specular_weight=0.8,
    fuzz_weight=0.12,
    fuzz_color=(0.8, 0.5, 0.3),
    base_diffuse_roughness=0.4,
)
scene.material("thread", base_color=(0.72, 0.6, 0.42), specular_weight=0.2, specular_roughness=0.7)
scene.material(
    "velvet",
    base_color=(0.02, 0.025, 0.03),
    specular_weight=0.0,
    fuzz_weight=1.0,
    fuzz_color=(0.25, 0.32, 0.38),
    fuzz_roughness=0.4,
)
scene.material("slab", base_color=(0.025, 0.027, 0.03), specular_roughness=0.16)
scene.material("paper", base_color=(0.3, 0.33, 0.37), specular_weight=0.0)


def crisp(*corners: tuple[float, float], bevel: float = 0.00012) -> np.ndarray:
    """A profile whose corners stay narrow under subdivision: two points for each, a bevel apart."""
    p = np.asarray(corners, float)
    made = [p[0]]
    for a, b, c in zip(p, p[1:], p[2:], strict=False):
        for to in (a, c):
            reach = np.linalg.norm(to - b)
            made.append(b + (to - b) * min(bevel / reach, 0.3))
    return np.array([*made, p[-1]])


def turned(path: str, profile: np.ndarray, around: int, material: str, at: tuple[float, float, float] = (0, 0, 0)) -> None:
    points, faces = turned_body(profile, around)
    scene.mesh(path, points + np.asarray(at), faces, material, st=about(points), subdivision="catmullClark")


def about(points: np.ndarray) -> np.ndarray:
    """Texture coordinates about +Y and across: at the seam they run backwards, which brushed metal does not mind."""
    return np.stack([np.arctan2(points[:, 2], points[:, 0]), points[:, 1] * 50 + np.hypot(points[:, 0], points[:, 2]) * 50], 1)


def disc(
    path: str, inner: float, outer: float, height: float, material: str, along: str, at: tuple[float, float] = (0, 0)
) -> None:
    """A flat ring whose grooves go along its radii or about it."""
    around = 128
    points, faces = lathe([(outer, height), ((outer + inner) / 2, height), (inner, height)], around)
    rows = len(points) // around
    phi = np.tile(np.arange(around + 1) / around, rows)
    r = np.repeat([1.0, 0.5, 0.0], around + 1)
    # The seam has points of its own, for st.
    points = points.reshape(rows, around, 3)
    points = np.concatenate([points, points[:, :1]], 1).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(rows - 1), np.arange(around), indexing="ij")
    a = (i * (around + 1) + k).ravel()
    faces = np.stack([a, a + around + 1, a + around + 2, a + 1], 1)
    st = np.stack([r, phi * 8], 1) if along == "radii" else np.stack([phi * 8, r], 1)
    scene.mesh(path, points + [at[0], 0, at[1]], faces, material, st=st)


def bar(length: float, width: float, height: float, tip: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A ridge along -z from the origin, narrower by `tip` at its end: bevelled, of quads."""
    sections = []
    for z, w, h in ((0.0, 0.8, 0.55), (0.0, 1, 0.7), (-length * 0.97, tip, 0.7), (-length, tip * 0.8, 0.55)):
        x = width * w / 2
        sections.append(
            [(-x, 0, z), (-x * 0.96, height * h, z), (0, height * (h + 0.3), z), (x * 0.96, height * h, z), (x, 0, z)]
        )
    points = np.array(sections).reshape(-1, 3)
    faces = [
        [5 * i + k, 5 * i + (k + 1) % 5, 5 * i + 5 + (k + 1) % 5, 5 * i + 5 + k]
        for i in range(3)
        for k in range(4 if i == 0 else 5)
    ]
    return points, np.array([*faces, [3, 2, 1, 0], [15, 16, 17, 18]])


def spun(points: np.ndarray, degrees: float, at: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Clockwise, seen from above, as hands go."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) + np.asarray(at)


def band(spine: np.ndarray, half: np.ndarray, thick: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A strap about a curve (n, 2) of z and y: rounded edges; and where its stitches may go: points of its outer side."""
    along = np.gradient(spine, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    out = np.stack([-along[:, 1], along[:, 0]], 1)
    section = np.array(
        [
            (-1, -0.3),
            (-1, 0.3),
            (-0.93, 0.75),
            (-0.8, 0.86),
            (-0.4, 1),
            (0.4, 1),
            (0.8, 0.86),
            (0.93, 0.75),
            (1, 0.3),
            (1, -0.3),
            (0.92, -0.8),
            (0.4, -0.9),
            (-0.4, -0.9),
            (-0.92, -0.8),
        ]
    )
    points = np.stack(
        [
            np.stack([half * x, spine[:, 1] + out[:, 1] * thick * y / 2, spine[:, 0] + out[:, 0] * thick * y / 2], 1)
            for x, y in section
        ],
        1,
    )
    n, m = len(spine), len(section)
    faces = [
        [i * m + k, i * m + (k + 1) % m, (i + 1) * m + (k + 1) % m, (i + 1) * m + k] for i in range(n - 1) for k in range(m)
    ]
    return points.reshape(-1, 3), np.array(faces)


W = "/watch"
UsdGeom.Xform.Define(scene.stage, W)
turned(
    f"{W}/case/body",
    crisp(
        (0, -0.0078),
        (0.0165, -0.0078),
        (0.0182, -0.0068),
        (0.0199, -0.0052),
        (0.0199, 0.0004),
        (0.0192, 0.0012),
        (0.0168, 0.0012),
        (0.0166, -0.0006),
        (0, -0.0006),
    ),
    96,
    "brushed",
)
ring = np.concatenate(
    [
        crisp((0.0193, 0.001), (0.0192, 0.0022), (0.0178, 0.0036), (0.0168, 0.0036), (0.0164, 0.0028), (0.0162, 0.0008)),
        [(0.0178, 0.0006)],
    ]
)
points, faces = lathe(np.concatenate([ring, ring[:1]]), 96)
scene.mesh(f"{W}/case/bezel", points, faces, "polished", subdivision="catmullClark")
disc(f"{W}/dial/face", 0.00001, 0.0163, 0.0, "dial", "radii")
points, faces = lathe([(0.0163, 0.0027), (0.0148, 0.0001)], 96)
scene.mesh(f"{W}/dial/rehaut", points, faces, "subdial", st=about(points))
ticks = [
    spun(
        np.array([(-w, 0.0001, -0.0147), (w, 0.0001, -0.0147), (w, 0.0001, -0.0147 + deep), (-w, 0.0001, -0.0147 + deep)]),
        6 * k,
    )
    for k in range(60)
    for w, deep in [((0.00012, 0.0011), (0.00007, 0.0007))[bool(k % 5)]]
]
scene.mesh(f"{W}/dial/ticks", np.concatenate(ticks), np.arange(240).reshape(-1, 4)[:, ::-1], "print")
SUB = (0.0, 0.0072)
disc(f"{W}/dial/small/face", 0.00001, 0.0042, 0.0001, "subdial", "about", SUB)
points, faces = lathe([(0.00445, 0.0), (0.0044, 0.0002), (0.0042, 0.0002), (0.00415, 0.0)], 64)
scene.mesh(f"{W}/dial/small/ring", points + [SUB[0], 0, SUB[1]], faces, "gold")
small = [
    spun(
        np.array([(-w, 0.00015, -0.0039), (w, 0.00015, -0.0039), (w, 0.00015, -0.0034), (-w, 0.00015, -0.0034)]),
        30 * k,
        (SUB[0], 0, SUB[1]),
    )
    for k in range(12)
    for w in [0.00006]
]
scene.mesh(f"{W}/dial/small/ticks", np.concatenate(small), np.arange(48).reshape(-1, 4)[:, ::-1], "print")
marks = []
for hour in range(12):
    if hour == 6:
        continue
    points, faces = bar(0.0034, 0.0011, 0.0006)
    for shift in (-0.0008, 0.0008) if hour == 0 else (0.0,):
        marks.append((spun(points + [shift, 0, -0.01], 30 * hour), faces))
scene.mesh(f"{W}/dial/marks", *joined(marks), "gold")
for name, length, width, tail, height, angle, at in (
    ("hour", 0.0085, 0.00165, 0.0016, 0.0007, 305, (0, 0)),
    ("minute", 0.0128, 0.0013, 0.0022, 0.0011, 54, (0, 0)),
    ("second", 0.0034, 0.00035, 0.001, 0.0004, 208, SUB),
):
    ahead, behind = bar(length, width, 0.00035, 0.35), bar(tail, width, 0.00035, 0.6)
    points, faces = joined([ahead, (spun(behind[0], 180), behind[1])])
    scene.mesh(f"{W}/hands/{name}", spun(points, angle, (at[0], height, at[1])), faces, "gold")
turned(f"{W}/hands/cap", crisp((0, 0.0002), (0.001, 0.0002), (0.001, 0.0016), (0.0007, 0.0018), (0, 0.0018)), 32, "gold")
turned(
    f"{W}/hands/small_cap",
    crisp((0, 0.0001), (0.0004, 0.0001), (0.0004, 0.0008), (0, 0.00085)),
    24,
    "gold",
    (SUB[0], 0, SUB[1]),
)
points, faces = lathe(
    [(0.0166, 0.0034), (0.0155, 0.0037), (0.011, 0.0041), (0.006, 0.00435), (0.002, 0.0045), (0.00001, 0.0045)], 96
)
scene.mesh(f"{W}/crystal", points, faces, "crystal", subdivision="catmullClark")

# The crown: fluted, on +x.
profile = crisp((0, 0), (0.0028, 0), (0.003, 0.0004), (0.003, 0.0028), (0.0026, 0.0034), (0, 0.0036))
points, faces = turned_body(profile, 144)
phi, r = np.arctan2(points[:, 2], points[:, 0]), np.hypot(points[:, 0], points[:, 2])
points[:, [0, 2]] *= (1 + 0.05 * np.clip(np.cos(phi * 24) * 2, -1, 1) * (r > 0.0027))[:, None]
points = np.stack([points[:, 1], -points[:, 0], points[:, 2]], 1) + [0.0203, -0.0024, 0]
scene.mesh(f"{W}/case/crown", points, faces, "polished")

# Lugs: four horns that bow down to the strap.
for i, (sx, sz) in enumerate(((1, 1), (-1, 1), (1, -1), (-1, -1))):
    bow = smoothed([(0.0138, -0.0012), (0.0185, -0.0012), (0.0222, -0.0028), (0.0245, -0.0062), (0.0248, -0.0085)], 3)
    way = np.gradient(bow, axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    up = np.stack([-way[:, 1], way[:, 0]], 1)
    deep = np.linspace(0.0048, 0.0026, len(bow))
    section = [(-1, 0.4), (-0.8, 0.5), (0.8, 0.5), (1, 0.4), (1, -0.4), (0.8, -0.5), (-0.8, -0.5), (-1, -0.4)]
    points = np.stack(
        [
            np.stack(
                [np.full(len(bow), 0.0119 + 0.0014 * x), bow[:, 1] + up[:, 1] * deep * y, bow[:, 0] + up[:, 0] * deep * y], 1
            )
            for x, y in section
        ],
        1,
    )
    n, m = len(bow), 8
    faces = [
        [a * m + k, a * m + (k + 1) % m, (a + 1) * m + (k + 1) % m, (a + 1) * m + k] for a in range(n - 1) for k in range(m)
    ]
    faces += [list(range(m))[::-1], [(n - 1) * m + k for k in range(m)]]
    points = points.reshape(-1, 3) * [sx, 1, sz]
    if sx * sz < 0:
        faces = [f[::-1] for f in faces]
    scene.mesh(f"{W}/case/lug{i}", points, [f[::-1] for f in faces], "polished", subdivision="catmullClark")

# The strap: from lug to lug about a wrist, and its stitches.
side = np.array(
    [
        (0.0208, -0.0052),
        (0.0258, -0.0092),
        (0.0284, -0.017),
        (0.0288, -0.0275),
        (0.0266, -0.038),
        (0.021, -0.0475),
        (0.0115, -0.0545),
        (0, -0.0568),
    ]
)
spine = smoothed(np.concatenate([side, side[-2::-1] * [-1, 1]]), 7)
t = np.linspace(0, 1, len(spine))
half = 0.0098 - 0.0012 * np.clip(np.sin(t * np.pi) * 1.4, 0, 1)
thick = 0.0024 + 0.0014 * np.exp(-(((np.abs(t - 0.5) - 0.5) / 0.06) ** 2))
points, faces = band(spine, half, thick)
faces = faces.tolist() + [list(range(14))[::-1], [len(points) - 14 + k for k in range(14)]]
scene.mesh(f"{W}/strap/leather", points, [f[::-1] for f in faces], "leather", subdivision="catmullClark")
rows = points.reshape(-1, 14, 3)
seam = []
for column in (3, 6):
    line = smoothed(rows[:, column] * [0.97, 1, 1], 4)
    far = np.cumsum(np.r_[0, np.linalg.norm(np.diff(line, axis=0), axis=1)])
    for start in np.arange(0.001, far[-1] - 0.003, 0.0034):
        at = np.stack([np.interp(start + np.linspace(0, 0.0023, 5), far, line[:, c]) for c in range(3)], 1)
        centre = at[2] * [0, 1, 1] + [at[2][0], 0, 0]
        out = (centre - [centre[0], -0.0305, 0]) / np.linalg.norm(centre - [centre[0], -0.0305, 0])
        way = (at[-1] - at[0]) / np.linalg.norm(at[-1] - at[0])
        side = np.cross(way, out)
        a = np.arange(8) * TAU / 8
        rings = [
            p + wide * (np.cos(a)[:, None] * side + np.sin(a)[:, None] * out * 0.7) + out * lift
            for p, wide, lift in zip(
                at, (0.00012, 0.00034, 0.0004, 0.00034, 0.00012), (-0.0002, 0.00012, 0.0002, 0.00012, -0.0002), strict=True
            )
        ]
        quads = np.array(
            [[i * 8 + k, i * 8 + (k + 1) % 8, i * 8 + 8 + (k + 1) % 8, i * 8 + 8 + k] for i in range(4) for k in range(8)]
        )
        seam.append((np.concatenate(rings), quads[:, ::-1]))
scene.mesh(f"{W}/strap/thread", *joined(seam), "thread", subdivision="catmullClark")

# The cushion inside, along x.
profile = smoothed(
    [(0, -0.0165), (0.012, -0.0163), (0.0163, -0.014), (0.017, 0), (0.0163, 0.014), (0.012, 0.0163), (0, 0.0165)], 4
)
points, faces = turned_body(profile, 40)
points = np.stack([points[:, 1], -points[:, 0] * 1.27 - 0.0305, points[:, 2] * 1.45], 1)
scene.mesh(f"{W}/cushion", points, faces, "velvet", subdivision="catmullClark")


def stood(path: str, yaw: float, tilt: float, at: tuple[float, float]) -> None:
    """The watch leans back on its strap, whose lowest point touches the slab."""
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    leather = np.concatenate([rows.reshape(-1, 3)])
    low = (leather[:, 1] * c - leather[:, 2] * s).min()
    middle = -0.0305 * s
    prim = UsdGeom.Xformable(scene.stage.GetPrimAtPath(path))
    prim.ClearXformOpOrder()
    prim.AddTranslateOp().Set(Gf.Vec3d(at[0], -low, at[1]))
    prim.AddRotateYOp().Set(yaw)
    prim.AddTranslateOp(opSuffix="middle").Set(Gf.Vec3d(0, 0, -middle))
    prim.AddRotateXOp().Set(tilt)


stood(W, 24, 56, (-0.012, 0.0))
other = UsdGeom.Xform.Define(scene.stage, "/other")
other.GetPrim().GetReferences().AddInternalReference(W)
other.GetPrim().SetInstanceable(True)
stood("/other", -30, 56, (0.085, -0.13))

# A slab with a bevel, on paper that bends up.
b = 0.0008
plate = [(-0.11, -0.19), (0.16, -0.19), (0.16, 0.075), (-0.11, 0.075)]
points = [
    (x + dx, y, z + dz)
    for y, i in ((-0.006, 0), (-b, 0), (0, b))
    for (x, z), (dx, dz) in zip(plate, ((i, i), (-i, i), (-i, -i), (i, -i)), strict=True)
]
faces = [[4 * i + k, 4 * i + 4 + k, 4 * i + 4 + (k + 1) % 4, 4 * i + (k + 1) % 4] for i in range(2) for k in range(4)]
scene.mesh("/set/slab", np.array(points), [*faces, [11, 10, 9, 8]], "slab")
sweep = smoothed([(1.0, -0.006), (0.1, -0.006), (-0.35, -0.006), (-0.6, 0.05), (-0.7, 0.25), (-0.72, 1.0)], 6)
points = np.array([(x, y, z) for z, y in sweep for x in (-1.5, 1.5)])
faces = [[2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2] for i in range(len(sweep) - 1)]
scene.mesh("/set/paper", points, faces, "paper", subdivision="catmullClark")

scene.rect_light("/lights/top", (-0.05, 0.42, 0.05), (0, 0.02, 0.0), (0.5, 0.22), 5.0, (1, 0.97, 0.93))
scene.rect_light("/lights/left", (-0.42, 0.14, 0.14), (0, 0.03, 0), (0.12, 0.34), 8.0, (1, 0.9, 0.78))
scene.rect_light("/lights/front", (-0.16, 0.1, 0.5), (0, 0.03, 0), (0.3, 0.2), 2.2, (1, 0.94, 0.86))
scene.rect_light("/lights/right", (0.4, 0.16, -0.08), (0, 0.03, 0), (0.1, 0.4), 7.0, (0.75, 0.88, 1))
scene.rect_light("/lights/backdrop", (0.1, 0.5, -0.4), (0.12, 0.1, -0.7), (0.4, 0.15), 5.0, (0.6, 0.78, 1))
scene.save()
