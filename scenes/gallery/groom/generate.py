"""Writes scene.usda and geometry.usdc: a small shaggy beast beside a ball of yarn. Made for primray; Apache-2.0.

python -m scenes.gallery.groom.generate
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, UsdGeom, UsdShade, Vt
from scenes.gallery.making import Scene, Triple, smoothed, tube, turned_body, vectors

TYPES = Sdf.ValueTypeNames
rng = np.random.default_rng(7)

BODY, RADII = np.array([0.0, 0.112, 0.0]), np.array([0.098, 0.112, 0.09])
EYES = np.array([[-0.0365, 0.142, 0.0765], [0.0365, 0.142, 0.0765]])
EYE = 0.0215
NOSE = np.array([0.0, 0.117, 0.093])


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def spiral(count: int) -> np.ndarray:
    """Directions, evenly about a sphere."""
    k = np.arange(count) + 0.5
    y, phi = 1 - 2 * k / count, np.pi * (3 - 5**0.5) * k
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(phi), y, r * np.sin(phi)], 1)


def waves(p: np.ndarray, seed: int, scale: float) -> np.ndarray:
    """A smooth field of three values about 0: sums of sines."""
    own = np.random.default_rng(seed)
    total = np.zeros((len(p), 3))
    for octave in range(3):
        way = own.normal(size=(3, 3)) * scale * 2**octave
        total += np.sin(p @ way.T + own.uniform(0, 6.28, 3)) * 0.5**octave
    return total


def tuft(strands: int, reach: float, length: float, bend: float, clump: float) -> np.ndarray:
    """Cubic Beziers (strands, 4, 3) that grow up +Y and bow towards +Z; tips draw together by `clump`."""
    phi, r = rng.uniform(0, 2 * np.pi, strands), reach * np.sqrt(rng.uniform(0, 1, strands))
    root = np.stack([r * np.cos(phi), np.zeros(strands), r * np.sin(phi)], 1)
    long = length * rng.uniform(0.72, 1.08, strands)[:, None]
    wild = rng.normal(0, 0.035, (strands, 3))
    out = np.array([0, np.cos(bend * 0.45), np.sin(bend * 0.45)]) + wild
    away = np.array([0, np.cos(bend), np.sin(bend)]) + wild * 1.6
    fall = np.array([0, np.cos(bend * 1.45), np.sin(bend * 1.45)]) + wild * 2.2
    spread = root * (1 - clump * np.array([0.0, 0.25, 0.7, 1.0]))[:, None, None]
    return np.stack(
        [
            spread[0],
            spread[1] + long * 0.33 * out,
            spread[2] + long * 0.33 * (out + away),
            spread[3] + long * 0.34 * (out + away + fall),
        ],
        1,
    )


def fur(path: str, beziers: np.ndarray, tone: np.ndarray, width: float, material: str) -> None:
    """Strands of cubic Beziers (n, 4, 3), each thinner towards its tip and of its own `tone`."""
    flat = np.round(beziers.reshape(-1, 3), 6)
    with scene.bulk():
        made = UsdGeom.BasisCurves.Define(scene.stage, path)
        made.CreateTypeAttr("cubic")
        made.CreateBasisAttr("bezier")
        made.CreateCurveVertexCountsAttr(Vt.IntArray([4] * len(beziers)))
        made.CreatePointsAttr(vectors(flat))
        made.CreateWidthsAttr(Vt.FloatArray([width, width * 0.35] * len(beziers)))
        made.SetWidthsInterpolation("varying")
        primvar = UsdGeom.PrimvarsAPI(made).CreatePrimvar("tone", TYPES.FloatArray, "uniform")
        primvar.Set(Vt.FloatArray.FromNumpy(np.round(tone * 32).astype(np.float32) / 32))
        made.CreateExtentAttr(vectors(np.stack([flat.min(0) - width, flat.max(0) + width])))
    scene.bind(made.GetPrim(), material)


def planted(kinds: list[np.ndarray], at: np.ndarray, normal: np.ndarray, comb: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Strands (n, strands, 4, 3) of tufts at points: +Y along normals, +Z as near as can be to `comb`."""
    side = unit(np.cross(normal, comb))
    frames = np.stack([side, normal, np.cross(side, normal)], 1) * scale[:, None, None]
    chosen = np.stack(kinds)[rng.integers(0, len(kinds), len(at))]
    return np.einsum("nspi,nij->nspj", chosen, frames) + at[:, None, None]


def hair(name: str, dark: Triple, light: Triple, longitudinal: float, azimuthal: float) -> None:
    """Chiang's fibres, between two colours by a primvar `tone`."""
    made = UsdShade.Material.Define(scene.stage, f"/looks/{name}")
    tone = scene.node(name, "tone", "geompropvalue_float", TYPES.Float, geomprop="tone")
    shade = scene.node(name, "shade", "mix_color3", TYPES.Color3f, bg=dark, fg=light, mix=tone)
    roughness = scene.node(
        name, "roughness", "chiang_hair_roughness", TYPES.Float2, longitudinal=longitudinal, azimuthal=azimuthal
    )
    shader = UsdShade.Shader(roughness.GetPrim())
    absorbed = scene.node(
        name, "absorption", "chiang_hair_absorption_from_color", TYPES.Vector3f, color=shade, azimuthal_roughness=azimuthal
    )
    bsdf = scene.node(name, "hair", "chiang_hair_bsdf", TYPES.Token, cuticle_angle=0.511)
    fibre = UsdShade.Shader(bsdf.GetPrim())
    shader.GetPrim().RemoveProperty("outputs:out")
    for lobe in ("R", "TT", "TRT"):
        given = shader.CreateOutput(f"roughness_{lobe}", TYPES.Float2)
        fibre.CreateInput(f"roughness_{lobe}", TYPES.Float2).ConnectToSource(given)
    UsdShade.Shader(absorbed.GetPrim()).GetPrim().RemoveProperty("outputs:out")
    absorption = UsdShade.Shader(absorbed.GetPrim()).CreateOutput("absorption", TYPES.Vector3f)
    fibre.CreateInput("absorption_coefficient", TYPES.Vector3f).ConnectToSource(absorption)
    surface = scene.node(name, "surface", "surface", TYPES.Token, bsdf=bsdf)
    made.CreateSurfaceOutput("mtlx").ConnectToSource(surface)


def ellipsoid(path: str, at: Triple, radii: Triple, material: str, turn: Triple = (0, 0, 0)) -> None:
    made = UsdGeom.Sphere.Define(scene.stage, path)
    made.CreateRadiusAttr(1)
    made.AddTranslateOp().Set(Gf.Vec3d(*at))
    if any(turn):
        made.AddRotateXYZOp().Set(Gf.Vec3f(*turn))
    made.AddScaleOp().Set(Gf.Vec3f(*radii))
    scene.bind(made.GetPrim(), material)


scene = Scene(__file__, "A small shaggy beast beside a ball of yarn.")
scene.camera(eye=(0.12, 0.16, 1.1), at=(0.055, 0.132, 0), focal_length=62, f_stop=2.8, focus=(0, 0.14, 0.08))

hair("fur", (0.42, 0.14, 0.04), (0.84, 0.53, 0.25), 0.36, 0.4)
scene.material("skin", base_color=(0.16, 0.07, 0.03), specular_weight=0.0)
scene.material("paws", base_color=(0.16, 0.075, 0.045), fuzz_weight=0.8, fuzz_color=(0.8, 0.55, 0.4), specular_roughness=0.6)
scene.material("nose", base_color=(0.05, 0.022, 0.02), specular_roughness=0.32, coat_weight=0.3, coat_roughness=0.25)
scene.material("eyes", base_color=(0.014, 0.007, 0.004), specular_roughness=0.05, specular_ior=1.6)
scene.material("iris", base_color=(0.5, 0.2, 0.04), specular_roughness=0.4)
scene.material(
    "horns",
    base_color=(0.8, 0.68, 0.5),
    subsurface_weight=1.0,
    subsurface_color=(0.85, 0.66, 0.45),
    subsurface_radius=0.006,
    specular_roughness=0.35,
)
scene.material(
    "yarn",
    base_color=(0.42, 0.06, 0.05),
    fuzz_weight=0.9,
    fuzz_color=(1.0, 0.55, 0.45),
    specular_weight=0.2,
    specular_roughness=0.7,
)
scene.material("floor", base_color=(0.07, 0.125, 0.14), specular_roughness=0.45, specular_weight=0.5)

# The beast: an egg in fur.
points, faces = turned_body([(np.sin(t) * (1 + 0.06 * np.cos(t)), -np.cos(t)) for t in np.linspace(0, np.pi, 17)], 28)
scene.mesh("/beast/skin", points * RADII * 0.985 + BODY, faces, "skin", subdivision="catmullClark")

ways = spiral(2300)
ways = unit(ways + rng.normal(0, 0.012, ways.shape))
roots = ways * RADII * [1, 1, 1] + BODY
shape = 1 + 0.06 * -ways[:, 1:2] * np.array([1, 0, 1])
roots = ways * RADII * shape + BODY
normals = unit(ways / RADII)
down = np.array([0, -1.0, 0])
# A parting over the crown: from it hair falls to either side; away from eyes and nose; swirls.
part = np.exp(-((ways[:, 0] / 0.5) ** 2)) * np.clip(ways[:, 1], 0, 1)
comb = down + part[:, None] * np.array([1.0, 0, 0]) * np.sign(ways[:, :1] + 0.02 * waves(ways, 3, 6)[:, :1]) * 1.8
comb = comb + 0.28 * waves(ways, 11, 4.0)
near = np.zeros(len(roots))
for centre, size in ((EYES[0], 0.034), (EYES[1], 0.034), (NOSE, 0.03)):
    off = roots - centre
    gap = np.linalg.norm(off, axis=1)
    close = np.exp(-((gap / size) ** 2))
    comb = comb + 3.0 * close[:, None] * unit(off)
    near = np.maximum(near, close)
keep = np.ones(len(roots), bool)
for centre in EYES:
    keep &= np.linalg.norm(roots - centre, axis=1) > EYE * 1.12
keep &= np.linalg.norm((roots - NOSE) / [0.017, 0.012, 0.02], axis=1) > 1.0
keep &= roots[:, 1] > 0.01
kinds = [
    tuft(11, 0.0085, long * 1.0, bend + 0.1, min(clump + 0.2, 0.95))
    for long, bend, clump in (
        (0.04, 1.05, 0.5),
        (0.043, 1.2, 0.65),
        (0.046, 0.9, 0.55),
        (0.04, 1.3, 0.35),
        (0.05, 1.1, 0.85),
        (0.036, 0.8, 0.25),
        (0.045, 1.15, 0.6),
        (0.042, 1.0, 0.7),
    )
]
top = np.clip(ways[:, 1], 0, 1)
scale = (1.0 + 0.75 * top**2 + 0.12 * waves(ways, 23, 3)[:, 0]) * (1 - 0.62 * near)
scale *= 1 - 0.35 * np.exp(-(((ways - unit(np.array([0, 0.1, 1.0]))) ** 2).sum(1)) / 0.3)
tone = 0.22 + 0.2 * waves(ways, 31, 2.5)[:, 0] + 0.12 * ways[:, 1]
face = np.exp(-(((ways - unit(np.array([0, -0.02, 1.0]))) ** 2).sum(1)) / 0.16)
tone = tone + (1 - tone) * np.clip(face * 1.1, 0, 0.9)
strands = planted(kinds, roots[keep], normals[keep], comb[keep], scale[keep])
tones = np.clip(tone[keep, None] + rng.normal(0, 0.09, strands.shape[:2]), 0, 1)
strands[..., 1] = np.maximum(strands[..., 1], 0.001)
fur("/beast/fur", strands.reshape(-1, 4, 3), tones.ravel(), 0.00068, "fur")

for side, centre in zip((-1, 1), EYES, strict=True):
    name = "left" if side < 0 else "right"
    scene.sphere(f"/beast/{name}/eye", tuple(centre.tolist()), EYE, "eyes")
    ellipsoid(f"/beast/{name}/foot", (side * 0.05, 0.0165, 0.085), (0.032, 0.018, 0.042), "paws", (0, side * 14, 0))
    bow = smoothed([(0, 0, 0), (0.016, 0.024, 0.002), (0.03, 0.046, 0.0), (0.034, 0.072, 0.006), (0.028, 0.094, 0.016)], 8)
    rings = np.linspace(0, 1, len(bow))
    wide = 0.0125 * (1 - rings**1.3 * 0.9) * (1 + 0.05 * np.sin(rings * 55))
    points, faces = tube(bow * [side, 1, 1] + [side * 0.042, 0.196, 0.0], wide, 20)
    scene.mesh(f"/beast/{name}/horn", points, faces, "horns", subdivision="catmullClark")
ellipsoid("/beast/nose", tuple(NOSE.tolist()), (0.0165, 0.0115, 0.012), "nose")

# Yarn: turns about a ball, each layer in its own way, and an end that lies on the floor.
BALL, WIDE = np.array([0.19, 0.047, 0.03]), 0.0042
turns = []
for layer in range(14):
    axis = unit(rng.normal(size=3))
    u = unit(np.cross(axis, [0.31, 0.5, 0.8]))
    v = np.cross(axis, u)
    for k in range(6):
        lean = (k - 2.5) * 0.088
        phi = np.linspace(0, 2 * np.pi, 25)[:-1]
        around = np.cos(lean) * (np.cos(phi)[:, None] * u + np.sin(phi)[:, None] * v) + np.sin(lean) * axis
        turns.append(BALL + around * (0.0415 + 0.0029 * layer / 14))
path = smoothed(
    [
        (0.2, 0.0025, 0.06),
        (0.17, 0.0022, 0.1),
        (0.09, 0.0022, 0.13),
        (0.03, 0.0022, 0.2),
        (0.1, 0.0022, 0.27),
        (0.2, 0.0022, 0.25),
        (0.3, 0.0022, 0.32),
    ],
    6,
)
for name, curves, wrap in (("turns", turns, "periodic"), ("end", [path], "pinned")):
    with scene.bulk():
        made = UsdGeom.BasisCurves.Define(scene.stage, f"/yarn/{name}")
        made.CreateTypeAttr("cubic")
        made.CreateBasisAttr("bspline")
        made.CreateWrapAttr(wrap)
        made.CreateCurveVertexCountsAttr(Vt.IntArray([len(c) for c in curves]))
        made.CreatePointsAttr(vectors(np.concatenate(curves)))
        made.CreateWidthsAttr(Vt.FloatArray([WIDE]))
        made.SetWidthsInterpolation("constant")
        flat = np.concatenate(curves)
        made.CreateExtentAttr(vectors(np.stack([flat.min(0) - WIDE, flat.max(0) + WIDE])))
    scene.bind(made.GetPrim(), "yarn")
scene.sphere("/yarn/core", tuple(BALL.tolist()), 0.041, "yarn")

# A floor that bends up into a wall.
sweep = smoothed([(2.0, 0.0), (0.2, 0.0), (-0.9, 0.0), (-1.5, 0.12), (-1.75, 0.6), (-1.8, 2.2)], 6)
points = np.array([(x, y, z) for z, y in sweep for x in (-3.0, 3.0)])
faces = [[2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2] for i in range(len(sweep) - 1)]
scene.mesh("/room/sweep", points, faces, "floor", subdivision="catmullClark")

scene.rect_light("/lights/key", (-0.7, 0.8, 0.9), (0, 0.12, 0), (0.6, 0.6), 17, (1, 0.86, 0.7))
scene.rect_light("/lights/rim", (0.85, 0.75, -0.75), (0, 0.13, 0), (0.35, 0.7), 19, (0.62, 0.82, 1))
scene.rect_light("/lights/glow", (-0.9, 0.55, -0.75), (0, 0.15, 0), (0.3, 0.6), 22, (1, 0.62, 0.32))
scene.rect_light("/lights/wall", (0.3, 1.7, -0.5), (0.1, 0.5, -1.8), (0.8, 0.3), 14, (0.4, 0.75, 0.85))
scene.rect_light("/lights/fill", (1.3, 0.5, 0.9), (0, 0.1, 0), (1.2, 1.2), 1.5, (0.7, 0.85, 1))
scene.save()
