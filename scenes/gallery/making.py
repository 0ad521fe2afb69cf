"""What the gallery's generators share: a stage of two layers, shapes as arrays, materials, lights, a camera.

A generator runs as `python -m scenes.gallery.NAME.generate`, from the repository's root. It writes scene.usda (camera, lights,
materials, settings: to be read) and, where there is much geometry, geometry.usdc, its sublayer. Lengths are metres, +Y is up.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade, Vt

Triple = tuple[float, float, float]
RESOLUTION = (1280, 720)


class Scene:
    """A stage that is being made; `save` writes it beside the generator, whose `__file__` is given."""

    def __init__(self, generator: str, doc: str, frames: tuple[float, float] | None = None) -> None:
        self.folder = Path(generator).resolve().parent
        self._bulk = Sdf.Layer.CreateAnonymous("geometry.usdc")
        self.stage = Usd.Stage.CreateInMemory()
        root = self.stage.GetRootLayer()
        root.subLayerPaths.append(self._bulk.identifier)
        root.documentation = f"{doc} Made for primray by generate.py. Apache-2.0."
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(self.stage, 1)
        if frames:
            self.stage.SetStartTimeCode(frames[0])
            self.stage.SetEndTimeCode(frames[1])

    @contextmanager
    def bulk(self) -> Iterator[None]:
        """What is authored inside goes to geometry.usdc."""
        with Usd.EditContext(self.stage, self._bulk):
            yield

    def camera(
        self, eye: Triple, at: Triple, focal_length: float = 35, f_stop: float = 0, focus: Triple | None = None
    ) -> UsdGeom.Camera:
        """Of a full-frame sensor cut to 16:9, lengths of it in mm; in focus at a point, where `f_stop` is not 0."""
        made = UsdGeom.Camera.Define(self.stage, "/camera")
        # USD counts them in tenths of a scene's unit, which is a metre here.
        made.CreateFocalLengthAttr(focal_length / 100)
        made.CreateHorizontalApertureAttr(0.36)
        made.CreateVerticalApertureAttr(0.36 * RESOLUTION[1] / RESOLUTION[0])
        made.CreateClippingRangeAttr(Gf.Vec2f(0.01, 10000))
        made.AddTransformOp().Set(looking(eye, at))
        if f_stop:
            made.CreateFStopAttr(f_stop)
            away = np.subtract(focus or at, eye)
            forward = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
            made.CreateFocusDistanceAttr(float(away @ forward))
        settings = UsdRender.Settings.Define(self.stage, "/render/settings")
        settings.CreateResolutionAttr(Gf.Vec2i(*RESOLUTION))
        settings.CreateCameraRel().SetTargets([made.GetPath()])
        self.stage.SetMetadata("renderSettingsPrimPath", "/render/settings")
        return made

    def mesh(
        self,
        path: str,
        points: np.ndarray,
        faces: np.ndarray | Sequence[Sequence[int]],
        material: str | None = None,
        *,
        normals: np.ndarray | None = None,
        st: np.ndarray | None = None,
        subdivision: str = "none",
    ) -> UsdGeom.Mesh:
        """Faces: an array (n, corners), or lists of any lengths; normals and st: one a point; material: a name in /looks."""
        with self.bulk():
            made = UsdGeom.Mesh.Define(self.stage, path)
            made.CreateSubdivisionSchemeAttr(subdivision)
            made.CreatePointsAttr(vectors(points))
            made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.array([len(face) for face in faces], np.int32)))
            made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.concatenate([np.asarray(f, np.int32) for f in faces])))
            made.CreateExtentAttr(vectors(np.stack([np.min(points, 0), np.max(points, 0)])))
            if normals is not None:
                made.CreateNormalsAttr(vectors(normals))
                made.SetNormalsInterpolation("vertex")
            if st is not None:
                primvars = UsdGeom.PrimvarsAPI(made)
                primvar = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
                primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(st, np.float32)))
        if material:
            self.bind(made.GetPrim(), material)
        return made

    def sphere(self, path: str, at: Triple, radius: float, material: str) -> UsdGeom.Sphere:
        made = UsdGeom.Sphere.Define(self.stage, path)
        made.CreateRadiusAttr(radius)
        made.AddTranslateOp().Set(Gf.Vec3d(*at))
        self.bind(made.GetPrim(), material)
        return made

    def material(self, name: str, **inputs: float | bool | Triple) -> UsdShade.Material:
        """OpenPBR of these inputs, as /looks/NAME."""
        made = UsdShade.Material.Define(self.stage, f"/looks/{name}")
        shader = UsdShade.Shader.Define(self.stage, f"/looks/{name}/surface")
        shader.CreateIdAttr("ND_open_pbr_surface_surfaceshader")
        types = Sdf.ValueTypeNames
        for key, value in inputs.items():
            kind = types.Color3f if isinstance(value, tuple) else types.Bool if isinstance(value, bool) else types.Float
            shader.CreateInput(key, kind).Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)
        made.CreateSurfaceOutput("mtlx").ConnectToSource(shader.CreateOutput("out", types.Token))
        return made

    def node(self, material: str, name: str, kind: str, out: Sdf.ValueTypeName, **inputs: object) -> UsdShade.Output:
        """A MaterialX node ND_KIND of a material; inputs: values, and outputs of other nodes."""
        made = UsdShade.Shader.Define(self.stage, f"/looks/{material}/{name}")
        made.CreateIdAttr(f"ND_{kind}")
        types = Sdf.ValueTypeNames
        for key, value in inputs.items():
            if isinstance(value, UsdShade.Output):
                made.CreateInput(key, value.GetTypeName()).ConnectToSource(value)
            elif isinstance(value, tuple):
                sort = types.Color3f if "color" in kind and "remap" not in key else types.Float3
                made.CreateInput(key, sort).Set(Gf.Vec3f(*value))
            else:
                sort = {int: types.Int, str: types.String}.get(type(value), types.Float)
                made.CreateInput(key, sort).Set(value)
        return made.CreateOutput("out", out)

    def feed(self, material: str, **inputs: UsdShade.Output) -> None:
        """Inputs of a material's surface that nodes give."""
        surface = UsdShade.Shader(self.stage.GetPrimAtPath(f"/looks/{material}/surface"))
        for key, value in inputs.items():
            surface.CreateInput(key, value.GetTypeName()).ConnectToSource(value)

    def bind(self, prim: Usd.Prim, material: str) -> None:
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material(self.stage.GetPrimAtPath(f"/looks/{material}")))

    def rect_light(
        self, path: str, eye: Triple, at: Triple, size: tuple[float, float], intensity: float, color: Triple = (1, 1, 1)
    ) -> UsdLux.RectLight:
        """Shines from `eye` to `at`."""
        made = UsdLux.RectLight.Define(self.stage, path)
        made.CreateWidthAttr(size[0])
        made.CreateHeightAttr(size[1])
        made.CreateIntensityAttr(intensity)
        made.CreateColorAttr(Gf.Vec3f(*color))
        made.AddTransformOp().Set(looking(eye, at))
        return made

    def ball_light(
        self, path: str, at: Triple, radius: float, intensity: float, color: Triple = (1, 1, 1)
    ) -> UsdLux.SphereLight:
        made = UsdLux.SphereLight.Define(self.stage, path)
        made.CreateRadiusAttr(radius)
        made.CreateIntensityAttr(intensity)
        made.CreateColorAttr(Gf.Vec3f(*color))
        made.AddTranslateOp().Set(Gf.Vec3d(*at))
        return made

    def sky(self, radiance: np.ndarray, name: str) -> UsdLux.DomeLight:
        """A dome of a latitude-longitude image (rows, columns, 3), written beside the stage; +Z is its middle column."""
        path = self.folder / name
        image = oiio.ImageOutput.create(str(path))
        spec = oiio.ImageSpec(radiance.shape[1], radiance.shape[0], 3, "half")
        spec.attribute("DateTime", "2026:11:27 00:00:00")  # else the file would be another each time
        image.open(str(path), spec)
        image.write_image(np.ascontiguousarray(radiance, np.float32))
        image.close()
        made = UsdLux.DomeLight.Define(self.stage, "/lights/sky")
        made.CreateTextureFileAttr(f"./{name}")
        made.CreateTextureFormatAttr("latlong")
        return made

    def save(self) -> None:
        written = Sdf.Layer.CreateAnonymous(".usda")
        written.TransferContent(self.stage.GetRootLayer())
        written.subLayerPaths.clear()
        # What is instanced from there is not drawn there.
        for layer in (written, self._bulk):
            if library := layer.GetPrimAtPath("/modules"):
                library.specifier = Sdf.SpecifierOver
        if not self._bulk.empty:
            self._bulk.Export(str(self.folder / "geometry.usdc"))
            written.subLayerPaths.append("./geometry.usdc")
        written.Export(str(self.folder / "scene.usda"))


def looking(eye: Triple, at: Triple) -> Gf.Matrix4d:
    """What stands at `eye` and looks, or shines, along its -Z to `at`."""
    up = Gf.Vec3d(0, 1, 0) if abs(eye[0] - at[0]) + abs(eye[2] - at[2]) > 1e-6 else Gf.Vec3d(0, 0, 1)
    return Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*at), up).GetInverse()


def dusk(glow: Triple, high: int = 128) -> np.ndarray:
    """A sky (high, 2 high, 3) with a glow of this colour over the horizon at -Z."""
    v, u = np.meshgrid((np.arange(high) + 0.5) / high, (np.arange(2 * high) + 0.5) / (2 * high), indexing="ij")
    up = np.clip(np.cos(np.pi * v), 0, 1)[..., None]
    beside = np.exp(-(((np.abs((u + 0.5) % 1 - 0.5)) / 0.16) ** 2))[..., None]
    low = np.exp(-up / 0.16)
    zenith, horizon = np.array([0.035, 0.075, 0.20]), np.array([0.16, 0.16, 0.26])
    sky = zenith + (horizon - zenith) * low + beside * (low + 0.1 * np.exp(-up / 0.4)) * np.array(glow)
    return sky * np.where(np.cos(np.pi * v) < 0, 0.3, 1.0)[..., None]


def vectors(values: np.ndarray) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def box(low: Triple, high: Triple) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward quads of an axis-aligned box."""
    points = np.array([[(low, high)[k >> i & 1][i] for i in range(3)] for k in range(8)])
    faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
    return points, np.array(faces)


def rounded_box(low: Triple, high: Triple, edge: float) -> tuple[np.ndarray, list[list[int]]]:
    """A box whose edges and corners are cut at `edge`, of polygons."""
    low_, high_ = np.asarray(low, float), np.asarray(high, float)
    points = np.empty((24, 3))  # for each corner one in the plane of each of its three faces
    for corner in range(8):
        sides = np.array([corner >> i & 1 for i in range(3)])
        inner = np.where(sides, high_ - edge, low_ + edge)
        for axis in range(3):
            points[corner * 3 + axis] = np.where(np.arange(3) == axis, np.where(sides, high_, low_), inner)
    _, quads = box(low, high)
    faces = [[c * 3 + int(f // 2) for c in quad] for f, quad in enumerate(quads)]
    for a in range(8):
        for axis in range(3):
            b = a ^ (1 << axis)
            if a < b:
                i, k = [other for other in range(3) if other != axis]
                edge_face = [a * 3 + i, a * 3 + k, b * 3 + k, b * 3 + i]
                faces.append(outward(points, edge_face, (low_ + high_) / 2))
        faces.append(outward(points, [a * 3, a * 3 + 1, a * 3 + 2], (low_ + high_) / 2))
    return points, faces


def outward(points: np.ndarray, face: list[int], centre: np.ndarray) -> list[int]:
    """The face, wound so that it looks away from the centre."""
    a, b, c = points[face[:3]]
    return face if np.cross(b - a, c - a) @ (a - centre) > 0 else face[::-1]


def turned(points: np.ndarray, degrees: float, to: Triple = (0, 0, 0)) -> np.ndarray:
    """Turned about +Y, then moved."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return points @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + to


def joined(parts: Sequence[tuple[np.ndarray, np.ndarray | list[list[int]]]]) -> tuple[np.ndarray, list[list[int]]]:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    faces = [[int(k + start) for k in face] for (_, these), start in zip(parts, starts, strict=False) for face in these]
    return np.concatenate([points for points, _ in parts]), faces


def lathe(profile: Sequence[tuple[float, float]] | np.ndarray, around: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and quads of a curve (radius, height) turned around +Y: outward where the curve goes up outside."""
    profile = np.asarray(profile, float)
    phi = 2 * np.pi * np.arange(around) / around
    r, y = profile[:, :1], profile[:, 1:]
    points = np.stack([r * np.cos(phi), np.repeat(y, around, 1), r * np.sin(phi)], -1).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(len(profile) - 1), np.arange(around), indexing="ij")
    a, b = i * around + k, i * around + (k + 1) % around
    return points, np.stack([a, a + around, b + around, b], -1).reshape(-1, 4)


def turned_body(profile: Sequence[tuple[float, float]] | np.ndarray, around: int) -> tuple[np.ndarray, list[list[int]]]:
    """A lathe's closed body: a profile that begins and ends on the axis, where it has poles; for subdivision."""
    profile = np.asarray(profile, float)
    points, quads = lathe(profile[1:-1], around)
    low, high = len(points), len(points) + 1
    last = len(points) - around
    faces = [list(map(int, quad)) for quad in quads]
    for k in range(around):
        n = (k + 1) % around
        faces += [[low, k, n], [high, last + n, last + k]]
    return np.concatenate([points, [[0, profile[0, 1], 0], [0, profile[-1, 1], 0]]]), faces


def inset(profile: np.ndarray, depth: float) -> np.ndarray:
    """The profile moved to its left, which is inwards where it goes up outside."""
    along = np.gradient(np.asarray(profile, float), axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return profile + depth * np.stack([-along[:, 1], along[:, 0]], 1)


def tube(path: np.ndarray, radii: np.ndarray | float, around: int) -> tuple[np.ndarray, list[list[int]]]:
    """A closed tube about points (n, 3), whose frames are turned no more than the path is."""
    path = np.asarray(path, float)
    radii = np.broadcast_to(radii, len(path))
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along[0], [0.3, 0.9, 0.31])
    rings = []
    for at, way, radius in zip(path, along, radii, strict=True):
        side = side - way * (side @ way)
        side /= np.linalg.norm(side)
        phi = 2 * np.pi * np.arange(around)[:, None] / around
        rings.append(at + radius * (np.cos(phi) * side + np.sin(phi) * np.cross(way, side)))
    faces = [
        [i * around + k, i * around + (k + 1) % around, (i + 1) * around + (k + 1) % around, (i + 1) * around + k]
        for i in range(len(path) - 1)
        for k in range(around)
    ]
    faces += [list(range(around))[::-1], list(range((len(path) - 1) * around, len(path) * around))]
    return np.concatenate(rings), faces


def smoothed(profile: Sequence[tuple[float, float]], steps: int) -> np.ndarray:
    """A curve through points (n, d): Catmull-Rom, `steps` pieces between two."""
    p = np.asarray(profile, float)
    p = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    t = (np.arange(steps) / steps)[:, None]
    pieces = [
        0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
        for a, b, c, d in zip(p, p[1:], p[2:], p[3:], strict=False)
    ]
    return np.concatenate([*pieces, p[-2:-1]])
