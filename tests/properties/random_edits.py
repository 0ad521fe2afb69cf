"""Random stages of a few things of every kind, and random edits of them: values, times, transforms, and what changes more."""

from __future__ import annotations

import random
from collections.abc import Callable

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

FRAMES = (1.0, 2.0)
FACES = ([4] * 6, [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3])
MATERIALS, MESHES, GROUPS = 3, 6, 2

Edit = Callable[[Usd.Stage, random.Random], str]


def stage_of(r: random.Random, image: str = "") -> Usd.Stage:
    """With that file on materials, and on a dome where there is one."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, "Y")
    for k in range(MATERIALS):
        _material(stage, f"/mats/m{k}", r)
    for k in range(MATERIALS - 1, 0, -1) if image else ():
        _textured(stage, f"/mats/m{k}", image, "rgb" if k > 1 else "r")
    for k in range(MESHES):
        _mesh(stage, f"/world/g{k % GROUPS}/m{k}", r, k)
    sphere = UsdGeom.Sphere.Define(stage, "/world/g0/ball")
    sphere.CreateRadiusAttr(0.5)
    _place(sphere, r)
    for kind in (UsdLux.SphereLight, UsdLux.RectLight, UsdLux.DistantLight):
        light = kind.Define(stage, f"/world/g1/{kind.__name__}")
        light.CreateIntensityAttr(r.uniform(0.5, 3.0) * (1 if kind is UsdLux.DistantLight else 20))
        _place(light, r)
    if r.random() < 0.5:
        dome = UsdLux.DomeLight.Define(stage, "/dome")
        dome.CreateIntensityAttr(0.2)
        if image:
            dome.CreateTextureFileAttr(image)
    if r.random() < 0.5:
        _instances(stage, r)
    for name in ("cam", "other"):
        camera = UsdGeom.Camera.Define(stage, f"/eyes/{name}")
        camera.AddTranslateOp().Set(Gf.Vec3d(r.uniform(-1, 1), r.uniform(0, 2), 9.0))
        camera.CreateFocalLengthAttr(35.0)
        if r.random() < 0.5:
            camera.GetPrim().CreateAttribute("primray:nearest", Sdf.ValueTypeNames.Double).Set(4.0)
    return stage


def enrich(stage: Usd.Stage, r: random.Random, image: str) -> None:
    """Add things that are costly to prepare, of some kinds each time: many lights, shapes that are diced."""
    for add in r.sample(list(COSTLY.values()), 3):
        add(stage, r, image)
    nearest = r.choice([0.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0])
    for path in ("/eyes/cam", "/eyes/other"):
        stage.GetPrimAtPath(path).CreateAttribute("primray:nearest", Sdf.ValueTypeNames.Double).Set(nearest)


def _many_lights(stage: Usd.Stage, r: random.Random, image: str) -> None:
    for k in range(12):
        kind = (UsdLux.SphereLight, UsdLux.RectLight, UsdLux.DiskLight)[k % 3]
        light = kind.Define(stage, f"/world/g1/many{k}")
        light.CreateIntensityAttr(r.uniform(5.0, 20.0))
        light.AddScaleOp().Set(Gf.Vec3f(0.2))
        _place(light, r)


def _emissive_grid(stage: Usd.Stage, r: random.Random, image: str) -> None:
    """Squares that emit light, by the texture of a material where it has one."""
    _material(stage, "/mats/grid", r)
    if r.random() < 0.5:
        _textured(stage, "/mats/grid", image, "rgb", "emissiveColor")
    else:
        stage.GetPrimAtPath("/mats/grid/surface").GetAttribute("inputs:emissiveColor").Set(_color(r) * 3)
    mesh = UsdGeom.Mesh.Define(stage, "/world/g0/grid")
    side = 8
    mesh.CreatePointsAttr([Gf.Vec3f(x / 4 - 1, r.uniform(0, 0.2), z / 4 - 1) for z in range(side) for x in range(side)])
    corners = [z * side + x for z in range(side - 1) for x in range(side - 1)]
    mesh.CreateFaceVertexCountsAttr([4] * len(corners))
    mesh.CreateFaceVertexIndicesAttr([i for c in corners for i in (c, c + side, c + side + 1, c + 1)])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set([Gf.Vec2f(x, z) / 8 for z in range(side) for x in range(side)])
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(UsdShade.Material(stage.GetPrimAtPath("/mats/grid")))
    _place(mesh, r)


def _light_mesh(stage: Usd.Stage, r: random.Random, image: str) -> None:
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/world/g1/m5"))
    UsdLux.MeshLightAPI.Apply(mesh.GetPrim())
    UsdLux.LightAPI(mesh).CreateIntensityAttr(2.0)


def _cages_in_instances(stage: Usd.Stage, r: random.Random, image: str) -> None:
    instancer = UsdGeom.PointInstancer.Define(stage, "/world/g0/crowd")
    _cage(stage, "/world/g0/crowd/kind", r)
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path("/world/g0/crowd/kind")])
    instancer.CreateProtoIndicesAttr([0] * 5)
    instancer.CreatePositionsAttr([Gf.Vec3f(_somewhere(r)) for _ in range(5)])
    source = stage.CreateClassPrim("/cages")
    _cage(stage, "/cages/one", r)
    prim = UsdGeom.Xform.Define(stage, "/world/g1/caged")
    prim.GetPrim().GetReferences().AddInternalReference(source.GetPath())
    prim.GetPrim().SetInstanceable(True)
    _place(prim, r)


def _cage(stage: Usd.Stage, path: str, r: random.Random) -> UsdGeom.Mesh:
    cage = UsdGeom.Mesh.Define(stage, path)
    cage.CreatePointsAttr(_box(r))
    cage.CreateFaceVertexCountsAttr(FACES[0])
    cage.CreateFaceVertexIndicesAttr(FACES[1])
    st = UsdGeom.PrimvarsAPI(cage).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    st.Set([Gf.Vec2f(x, y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))] * 6)
    return cage


def _displaced_cage(stage: Usd.Stage, r: random.Random, image: str) -> None:
    _material(stage, "/mats/moved", r)
    _textured(stage, "/mats/moved", image, "r", "displacement")
    stage.GetPrimAtPath("/mats/moved/texture").CreateAttribute("inputs:scale", Sdf.ValueTypeNames.Float4).Set(
        Gf.Vec4f(r.uniform(0.02, 0.2))
    )
    for k in range(2):
        cage = _cage(stage, f"/world/g{k}/displaced", r)
        UsdShade.MaterialBindingAPI.Apply(cage.GetPrim()).Bind(UsdShade.Material(stage.GetPrimAtPath("/mats/moved")))
        _place(cage, r)


def _patch(stage: Usd.Stage, r: random.Random, image: str) -> None:
    patch = UsdGeom.NurbsPatch.Define(stage, "/world/g1/patch")
    patch.CreatePointsAttr([Gf.Vec3f(x / 2 - 1, r.uniform(-0.3, 0.3), z / 2 - 1) for z in range(5) for x in range(5)])
    knots = [0, 0, 0, 0, 1, 2, 2, 2, 2]
    patch.CreateUVertexCountAttr(5), patch.CreateVVertexCountAttr(5)
    patch.CreateUOrderAttr(4), patch.CreateVOrderAttr(4)
    patch.CreateUKnotsAttr(knots), patch.CreateVKnotsAttr(knots)
    _place(patch, r)


def _ribbons(stage: Usd.Stage, r: random.Random, image: str) -> None:
    ribbons = UsdGeom.BasisCurves.Define(stage, "/world/g0/ribbons")
    ribbons.CreatePointsAttr([Gf.Vec3f(r.uniform(-1, 1), y, r.uniform(-1, 1)) for _ in range(6) for y in range(4)])
    ribbons.CreateCurveVertexCountsAttr([4] * 6)
    ribbons.CreateTypeAttr("cubic")
    ribbons.CreateBasisAttr("bezier")
    ribbons.CreateNormalsAttr([Gf.Vec3f(0, 0, 1)] * 12)
    ribbons.SetNormalsInterpolation("varying")
    ribbons.CreateWidthsAttr([0.2])
    ribbons.SetWidthsInterpolation("constant")
    _place(ribbons, r)


COSTLY: dict[str, Callable[[Usd.Stage, random.Random, str], None]] = {
    "lights": _many_lights,
    "emissive mesh": _emissive_grid,
    "mesh light": _light_mesh,
    "cages in instances": _cages_in_instances,
    "displaced cages": _displaced_cage,
    "NURBS": _patch,
    "ribbons": _ribbons,
}


def _material(stage: Usd.Stage, path: str, r: random.Random) -> None:
    made = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(_color(r))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(r.uniform(0.1, 1.0))
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(1.0)
    shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.0))
    made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")


def _textured(stage: Usd.Stage, path: str, image: str, channels: str, read: str = "") -> None:
    """With colours from the image or, from its red, roughness; or with the input `read` from it."""
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"{path}/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(image)
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    surface = UsdShade.Shader(stage.GetPrimAtPath(f"{path}/surface"))
    read = read or ("diffuseColor" if channels == "rgb" else "roughness")
    kind = Sdf.ValueTypeNames.Color3f if channels == "rgb" else Sdf.ValueTypeNames.Float
    surface.CreateInput(read, kind).ConnectToSource(texture.ConnectableAPI(), channels)


def _mesh(stage: Usd.Stage, path: str, r: random.Random, k: int) -> None:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(_box(r))
    mesh.CreateFaceVertexCountsAttr(FACES[0])
    mesh.CreateFaceVertexIndicesAttr(FACES[1])
    mesh.CreateSubdivisionSchemeAttr("none" if k else r.choice(["none", "catmullClark"]))
    mesh.CreateDisplayColorAttr([_color(r)])
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    st.Set([Gf.Vec2f(x, y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))] * 6)
    _place(mesh, r)
    if k % 3:
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(
            UsdShade.Material(stage.GetPrimAtPath(f"/mats/m{k % MATERIALS}"))
        )


def _instances(stage: Usd.Stage, r: random.Random) -> None:
    source = stage.CreateClassPrim("/kind")
    UsdGeom.Cube.Define(stage, "/kind/cube").CreateSizeAttr(0.6)
    for k in range(3):
        prim = UsdGeom.Xform.Define(stage, f"/world/i{k}")
        prim.GetPrim().GetReferences().AddInternalReference(source.GetPath())
        prim.GetPrim().SetInstanceable(True)
        _place(prim, r)


def _box(r: random.Random) -> list[Gf.Vec3f]:
    size = r.uniform(0.3, 0.7)
    return [Gf.Vec3f(x, y, z) for x in (-size, size) for y in (-size, size) for z in (-size, size)]


def _color(r: random.Random) -> Gf.Vec3f:
    return Gf.Vec3f(r.random(), r.random(), r.random())


def _place(prim: UsdGeom.Xformable, r: random.Random) -> None:
    prim.AddTranslateOp().Set(_somewhere(r))
    prim.AddRotateXYZOp().Set(Gf.Vec3f(r.uniform(-40, 40), r.uniform(-40, 40), 0))


def _somewhere(r: random.Random) -> Gf.Vec3d:
    return Gf.Vec3d(r.uniform(-2, 2), r.uniform(-1, 2), r.uniform(-2, 2))


def _any(stage: Usd.Stage, r: random.Random, kind: type) -> Usd.Prim | None:
    found = [prim for prim in stage.Traverse() if prim.IsA(kind)]
    return r.choice(found) if found else None


def _set(prim: Usd.Prim, name: str, value: object, time: Usd.TimeCode = Usd.TimeCode.Default()) -> str:  # noqa: B008
    prim.GetAttribute(name).Set(value, time)
    return f"{prim.GetPath()}.{name} = {value}"


def light(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdLux.NonboundableLightBase if r.random() < 0.2 else UsdLux.BoundableLightBase)
    if prim is None:
        return "no light"
    api = UsdLux.LightAPI(prim)
    if r.random() < 0.5:
        api.CreateColorAttr().Set(_color(r))
        return f"{prim.GetPath()} color"
    return _set(
        prim, "inputs:intensity", r.choice([0.0, r.uniform(0.5, 30.0), -1.0, float("inf")] + [r.uniform(0.5, 30.0)] * 4)
    )


def material(stage: Usd.Stage, r: random.Random) -> str:
    prim = r.choice([prim for prim in stage.Traverse() if prim.HasAttribute("inputs:roughness")])
    name, value = r.choice(
        [
            ("diffuseColor", _color(r)),
            ("roughness", r.choice([0.0, r.random(), 2.0])),
            ("opacity", r.choice([1.0, 0.5])),
            ("emissiveColor", r.choice([Gf.Vec3f(0.0), _color(r) * 3])),
        ]
    )
    return _set(prim, f"inputs:{name}", value)


def camera(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdGeom.Camera)
    if prim is None:
        return "no camera"
    if r.random() < 0.5:
        return _set(prim, "focalLength", r.uniform(25, 60))
    if r.random() < 0.5:  # to where lengths are measured from the same point, mostly
        here = prim.GetAttribute("xformOp:translate").Get()
        return _set(prim, "xformOp:translate", here + Gf.Vec3d(*(r.uniform(-0.05, 0.05) for _ in range(3))))
    if r.random() < 0.3 and prim.HasAttribute("primray:nearest"):
        return _set(prim, "primray:nearest", r.choice([0.0, 2.0, 4.0, 4.0, 4.0, -1.0]))
    near = 9.0 + r.uniform(-0.001, 0.001) if r.random() < 0.5 else r.uniform(7, 12)
    return _set(prim, "xformOp:translate", Gf.Vec3d(r.uniform(-1, 1), r.uniform(0, 2), near))


def transform(stage: Usd.Stage, r: random.Random) -> str:
    found = [prim for prim in stage.Traverse() if prim.HasAttribute("xformOp:rotateXYZ")]
    if not found:
        return "nothing to move"
    prim = r.choice(found)
    if r.random() < 0.7:
        return _set(prim, "xformOp:translate", r.choice([_somewhere(r)] * 5 + [Gf.Vec3d(1e9, 0, 0)]))
    return _set(prim, "xformOp:rotateXYZ", Gf.Vec3f(0, r.uniform(0, 360), 0))


def of_group(stage: Usd.Stage, r: random.Random) -> str:
    """Above many things; the first time its order of operations is new."""
    group = UsdGeom.Xformable(stage.GetPrimAtPath(f"/world/g{r.randrange(GROUPS)}"))
    if not group:
        return "no group"
    operations = group.GetOrderedXformOps()
    (operations[0] if operations else group.AddTranslateOp()).Set(_somewhere(r) * 0.3)
    return f"{group.GetPath()} moved"


def animated(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdGeom.Xformable)
    if prim is None or not prim.HasAttribute("xformOp:translate"):
        return "nothing to animate"
    values = [_set(prim, "xformOp:translate", _somewhere(r) + Gf.Vec3d(0, 0, 4), Usd.TimeCode(t)) for t in FRAMES]
    return values[-1]


def points(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdGeom.Mesh)
    if prim is None or len(prim.GetAttribute("points").Get()) != 8:
        return "no mesh"
    return _set(prim, "points", _box(r))[:60]


def size(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdGeom.Sphere)
    return "no sphere" if prim is None else _set(prim, "radius", r.choice([0.0, r.uniform(0.2, 0.8)]))


def color(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdGeom.Mesh)
    return "no mesh" if prim is None else _set(prim, "primvars:displayColor", [_color(r)])


def visibility(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdGeom.Imageable)
    if prim is None:
        return "nothing to hide"
    UsdGeom.Imageable(prim).CreateVisibilityAttr().Set(r.choice(["invisible", "inherited", "inherited"]))
    return f"{prim.GetPath()} visibility"


def binding(stage: Usd.Stage, r: random.Random) -> str:
    prim, bound = _any(stage, r, UsdGeom.Gprim), _any(stage, r, UsdShade.Material)
    if prim is None or bound is None:
        return "nothing to bind"
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material(bound))
    return f"{prim.GetPath()} bound to {bound.GetPath()}"


def addition(stage: Usd.Stage, r: random.Random) -> str:
    path = f"/world/g1/new{r.randrange(100)}"
    if r.random() < 0.5:
        UsdGeom.Cube.Define(stage, path)
    else:
        UsdLux.DiskLight.Define(stage, path).CreateIntensityAttr(3.0)
    if not stage.GetPrimAtPath(path).HasAttribute("xformOp:translate"):
        _place(UsdGeom.Xformable(stage.GetPrimAtPath(path)), r)
    return f"{path} added"


def removal(stage: Usd.Stage, r: random.Random) -> str:
    prim = _any(stage, r, UsdGeom.Gprim)
    if prim is None or not stage.RemovePrim(prim.GetPath()):
        return "nothing to remove"
    return "removed"


def units(stage: Usd.Stage, r: random.Random) -> str:
    UsdGeom.SetStageMetersPerUnit(stage, r.choice([0.01, 1.0]))
    return "units"


def step(stage: Usd.Stage, r: random.Random) -> str:
    """Move all cameras a little, or further than what is diced for them stays."""
    by = Gf.Vec3d(*(r.uniform(-1, 1) for _ in range(3))) * r.choice([0.02, 0.02, 0.02, 0.6])
    for prim in stage.GetPrimAtPath("/eyes").GetChildren():
        place = prim.GetAttribute("xformOp:translate")
        place.Set(place.Get() + by)
    return f"all cameras by {by}"


def diced(stage: Usd.Stage, r: random.Random) -> str:
    """Change what decides the triangles of a shape that is diced."""
    paths = ("/world/g0/crowd", "/mats/moved/texture", "/world/g1/patch", "/world/g0/ribbons", "/world/g0/crowd/kind")
    found = [prim for path in paths if (prim := stage.GetPrimAtPath(path))]
    if not found:
        return "nothing is diced"
    prim = r.choice(found)
    if prim.IsA(UsdGeom.PointInstancer):
        return _set(prim, "positions", [Gf.Vec3f(_somewhere(r)) for _ in range(5)])
    if prim.IsA(UsdGeom.Mesh):
        return _set(prim, "points", _box(r))[:60]
    if prim.IsA(UsdGeom.BasisCurves):
        return _set(prim, "widths", [r.uniform(0.05, 0.3)])
    if prim.IsA(UsdGeom.NurbsPatch):
        return _set(prim, "points", [p + Gf.Vec3f(0, r.uniform(-0.1, 0.1), 0) for p in prim.GetAttribute("points").Get()])[:60]
    return _set(prim, "inputs:scale", Gf.Vec4f(r.uniform(0.02, 0.2)))


RICH: tuple[tuple[Edit, int], ...] = ((step, 60), (diced, 6))
EDITS: tuple[tuple[Edit, int], ...] = (
    (light, 4),
    (material, 4),
    (camera, 4),
    (transform, 6),
    (of_group, 2),
    (animated, 1),
    (points, 1),
    (size, 1),
    (color, 1),
    (visibility, 1),
    (binding, 1),
    (addition, 1),
    (removal, 1),
    (units, 1),
)


def edit(stage: Usd.Stage, r: random.Random, edits: tuple[tuple[Edit, int], ...] = EDITS) -> str:
    """One edit, or two at once; what it was, for messages."""
    chosen = r.choices([each for each, _ in edits], [weight for _, weight in edits], k=r.choice([1, 1, 1, 2]))
    return "; ".join(f"{each.__name__}: {each(stage, r)}" for each in chosen)
