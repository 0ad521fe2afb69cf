"""A compared scene as USD: what primray renders, and where Cycles takes its meshes from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from .scene import Lamp, Layered, Look, Rgb, Scene, Strands
from .shapes import Triangles, look_at, perpendicular
from .usd_motion import write_motion

Types = Sdf.ValueTypeNames
CAMERA = "/world/camera"


def write_usd(scene: Scene, path: Path) -> None:
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    for scope in ("/world", "/world/geometry", "/world/lights"):
        UsdGeom.Xform.Define(stage, scope)
    stage.SetDefaultPrim(stage.GetPrimAtPath("/world"))
    for name, look in scene.looks.items():
        if look.kind == "hair":
            _hair(stage, f"/world/looks/{name}", look)
        elif isinstance(look, Layered):
            _open_pbr(stage, f"/world/looks/{name}", look)
        elif look.kind in ("metal", "plastic", "glass", "ember"):
            _material(stage, f"/world/looks/{name}", look)
    for mesh, bound in scene.objects:
        _mesh(stage, f"/world/geometry/{mesh}", scene.meshes[mesh], bound, scene.looks[bound])
    if scene.placed is not None:
        _instancer(stage, scene)
    if scene.strands is not None:
        _strands(stage, scene.strands)
    for k, lamp in enumerate(scene.lamps):
        _light(stage, f"/world/lights/light_{k}", lamp)
    _camera(stage, scene)
    if scene.moves:
        write_motion(stage, scene, CAMERA)
    stage.Save()


def _material(stage: Usd.Stage, path: str, look: Look) -> None:
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    glows = look.kind == "ember"  # on a black metal, which reflects nothing
    surface.CreateInput("emissiveColor" if glows else "diffuseColor", Types.Color3f).Set(Gf.Vec3f(*look.color))
    surface.CreateInput("roughness", Types.Float).Set(look.roughness)
    if glows:
        surface.CreateInput("diffuseColor", Types.Color3f).Set(Gf.Vec3f(0, 0, 0))
    if look.kind in ("metal", "ember"):
        surface.CreateInput("metallic", Types.Float).Set(1.0)
    if look.kind == "glass":
        surface.CreateInput("opacity", Types.Float).Set(0.0)
        surface.CreateInput("ior", Types.Float).Set(look.ior)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")


def _open_pbr(stage: Usd.Stage, path: str, look: Layered) -> None:
    """Without darkening below the coat, which the others don't have."""
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("ND_open_pbr_surface_surfaceshader")
    for name, value in {
        "base_metalness": look.metalness,
        "specular_roughness": look.roughness,
        "specular_ior": look.ior,
        "transmission_weight": look.transmission,
        "coat_weight": look.coat,
        "coat_roughness": 0.1,
        "coat_ior": 1.5,
        "coat_darkening": 0.0,
        "fuzz_weight": look.fuzz,
        "subsurface_weight": look.subsurface,
        "subsurface_radius": 1.0,
    }.items():
        surface.CreateInput(name, Types.Float).Set(value)
    colors = {
        "base_color": look.color,
        "transmission_color": look.color,
        "subsurface_color": look.color,
        "subsurface_radius_scale": look.radius,
    }
    for name, color in colors.items():
        surface.CreateInput(name, Types.Color3f).Set(Gf.Vec3f(*color))
    material.CreateSurfaceOutput("mtlx").ConnectToSource(surface.ConnectableAPI(), "out")


def _mesh(stage: Usd.Stage, path: str, shape: Triangles, name: str, look: Look) -> UsdGeom.Mesh:
    """A diffuse surface is displayColor without a material: Lambert, where UsdPreviewSurface has a specular lobe as well."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = shape.points.astype(np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.faces), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(shape.faces.ravel())))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateExtentAttr([Gf.Vec3f(*(float(x) for x in corner)) for corner in (points.min(axis=0), points.max(axis=0))])
    if shape.normals is not None:
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(shape.normals.astype(np.float32)))
        mesh.SetNormalsInterpolation("vertex")
    if look.kind == "glow":
        _shine(UsdLux.MeshLightAPI.Apply(mesh.GetPrim()), look.color)
    elif look.kind == "diffuse":
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*look.color)])
    else:
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(UsdShade.Material.Get(stage, f"/world/looks/{name}"))
    return mesh


def _hair(stage: Usd.Stage, path: str, look: Look) -> None:
    material = UsdShade.Material.Define(stage, path)
    shaders = {name: UsdShade.Shader.Define(stage, f"{path}/{name}") for name in ("surface", "hair", "widths")}
    surface, hair, widths = shaders.values()
    (
        surface.CreateIdAttr("ND_surface"),
        hair.CreateIdAttr("ND_chiang_hair_bsdf"),
        widths.CreateIdAttr("ND_chiang_hair_roughness"),
    )
    surface.CreateInput("bsdf", Types.Token).ConnectToSource(hair.ConnectableAPI(), "out")
    for name in ("longitudinal", "azimuthal"):
        widths.CreateInput(name, Types.Float).Set(look.roughness)
    for lobe in ("R", "TT", "TRT"):
        hair.CreateInput(f"roughness_{lobe}", Types.Float2).ConnectToSource(widths.ConnectableAPI(), f"roughness_{lobe}")
    hair.CreateInput("absorption_coefficient", Types.Vector3f).Set(Gf.Vec3f(*look.color))
    hair.CreateInput("ior", Types.Float).Set(look.ior)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(surface.ConnectableAPI(), "out")


def _strands(stage: Usd.Stage, strands: Strands) -> None:
    curves = UsdGeom.BasisCurves.Define(stage, "/world/geometry/strands")
    count, length = strands.points.shape[:2]
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(strands.points.reshape(-1, 3).astype(np.float32)))
    curves.CreateCurveVertexCountsAttr(Vt.IntArray(count, length))
    curves.CreateBasisAttr("bspline")
    curves.CreateWidthsAttr([2 * strands.radius])
    curves.SetWidthsInterpolation("constant")
    UsdShade.MaterialBindingAPI.Apply(curves.GetPrim()).Bind(UsdShade.Material.Get(stage, f"/world/looks/{strands.look}"))


def _instancer(stage: Usd.Stage, scene: Scene) -> None:
    placed = scene.placed
    assert placed is not None
    instancer = UsdGeom.PointInstancer.Define(stage, "/world/geometry/placed")
    path = f"/world/geometry/placed/{placed.mesh}"
    _mesh(stage, path, scene.meshes[placed.mesh], placed.look, scene.looks[placed.look])
    instancer.CreatePrototypesRel().SetTargets([path])
    instancer.CreateProtoIndicesAttr(Vt.IntArray(len(placed.positions), 0))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(placed.positions))
    imaginary_first = np.ascontiguousarray(placed.quaternions[:, [1, 2, 3, 0]])  # as Gf's quaternions lie in memory
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(imaginary_first))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.repeat(placed.scales[:, None], 3, axis=1)))


def _light(stage: Usd.Stage, path: str, lamp: Lamp) -> None:
    if lamp.kind == "sky":
        dome = UsdLux.DomeLight.Define(stage, path)
        dome.CreateTextureFileAttr(f"./{lamp.image}")
        dome.CreateTextureFormatAttr("latlong")
        return
    light: UsdLux.SphereLight | UsdLux.RectLight | UsdLux.DiskLight | UsdLux.CylinderLight | UsdLux.DistantLight
    if lamp.kind == "ball":
        light = UsdLux.SphereLight.Define(stage, path)
        light.CreateRadiusAttr(lamp.radius)
        light.AddTranslateOp().Set(Gf.Vec3d(*lamp.center))
    elif lamp.kind == "tube":
        light = UsdLux.CylinderLight.Define(stage, path)
        half = float(np.linalg.norm(lamp.half_u))
        light.CreateLengthAttr(2 * half)
        light.CreateRadiusAttr(lamp.radius)
        along = np.asarray(lamp.half_u) / half  # its x
        across = perpendicular(along)
        across /= np.linalg.norm(across)
        matrix = np.eye(4)
        matrix[:3] = np.stack([along, across, np.cross(along, across), lamp.center], axis=1)
        _place(light, matrix)
    elif lamp.kind in ("rect", "disc"):
        u, v = np.asarray(lamp.half_u), np.asarray(lamp.half_v)
        width, height = np.linalg.norm(u), np.linalg.norm(v)
        if lamp.kind == "rect":
            light = UsdLux.RectLight.Define(stage, path)
            light.CreateWidthAttr(float(2 * width))
            light.CreateHeightAttr(float(2 * height))
        else:
            light = UsdLux.DiskLight.Define(stage, path)
            light.CreateRadiusAttr(float(width))
        matrix = np.eye(4)  # it emits along -z, u x v: so its y is -v
        matrix[:3] = np.stack([u / width, -v / height, -np.cross(u / width, v / height), lamp.center], axis=1)
        _place(light, matrix)
    else:
        light = UsdLux.DistantLight.Define(stage, path)
        light.CreateAngleAttr(0.0)
        light.CreateNormalizeAttr(True)
        _place(light, look_at((0.0, 0.0, 0.0), lamp.direction))
    _shine(light, lamp.radiance)


def _shine(light: Any, radiance: Rgb) -> None:
    light = UsdLux.LightAPI(light)
    strongest = max(radiance)
    light.CreateIntensityAttr(strongest)
    light.CreateColorAttr(Gf.Vec3f(*(c / strongest for c in radiance)))


def _place(prim: UsdGeom.Xformable, matrix: np.ndarray) -> None:  # type: ignore[type-arg]
    """Column vectors; USD's are rows."""
    prim.AddTransformOp().Set(Gf.Matrix4d(*(float(x) for x in matrix.T.ravel())))


def _camera(stage: Usd.Stage, scene: Scene) -> None:
    camera = UsdGeom.Camera.Define(stage, CAMERA)
    width, height = scene.resolution
    _place(camera, look_at(scene.camera.eye, scene.camera.target))
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(36.0 * height / width)
    camera.CreateFocalLengthAttr(float(18.0 / np.tan(np.radians(scene.camera.fov_deg / 2))))
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1e5))
