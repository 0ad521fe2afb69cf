"""Random stages of what prims hand down: visibility, purpose, primvars, draw modes, bindings, transforms, types and kinds.

Native instances and point instancers are nested; their prototypes are below them, elsewhere, below `class` and `over`, and
in each other. Whole numbers everywhere, so that matrices are exact.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

MATERIALS, PROTOTYPES = 3, 3  # prototypes of native instances: each may hold instances of those before it
FALLBACK = (0.0625, 0.25, 0.5)  # of the materials that read a primvar
# Imageable ones, and those that are not: without a type, without a schema. New... have fallbacks.
GROUPS = ("Xform", "Xform", "Xform", "Scope", "", "VendorGroup", "NewXform")
LEAVES = ("Cube", "Sphere", "NewCube")
_TYPES = Sdf.ValueTypeNames


@dataclass
class _Maker:
    stage: Usd.Stage
    r: random.Random
    color_spaces: bool
    collections: bool
    count: int = 0
    inside: list[list[str]] = field(default_factory=list)  # of each native prototype, the paths below its root
    in_library: list[str] = field(default_factory=list)
    beside: list[str] = field(default_factory=list)  # below the root that is being made, in native instances too

    def chance(self, one_in: float) -> bool:
        return self.r.random() * one_in < 1

    def path(self, above: str, letter: str) -> str:
        self.count += 1
        return f"{above}/{letter}{self.count}"

    def color(self) -> tuple[float, float, float]:
        return (self.r.randint(0, 8) / 8, self.r.randint(0, 8) / 8, self.r.randint(0, 8) / 8)


def stage_of(seed: int, *, color_spaces: bool = False) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, "Y")
    fallbacks = {"NewCube": ["NewestCube", "Cube"], "NewXform": ["Xform"], "Cube": ["Sphere"]}
    stage.SetMetadata("fallbackPrimTypes", {name: Vt.TokenArray(to) for name, to in fallbacks.items()})
    make = _Maker(stage, random.Random(seed), color_spaces, collections=seed % 2 == 0)
    UsdGeom.Camera.Define(stage, "/camera")
    for k in range(MATERIALS):
        _material(stage, f"/m{k}")
    make.in_library = _group(make, "/early", 1, in_prototype=True)
    stage.GetPrimAtPath("/early").SetSpecifier(Sdf.SpecifierOver)
    for k in range(PROTOTYPES):
        root, make.beside = f"/protos/proto{k}", []
        paths = _group(make, root, 2, in_prototype=True)
        make.inside.append([path.removeprefix(root) for path in paths])
    make.in_library += _group(make, "/lib", 2, in_prototype=True)
    stage.GetPrimAtPath("/protos").SetSpecifier(Sdf.SpecifierOver)
    stage.GetPrimAtPath("/lib").SetSpecifier(make.r.choice([Sdf.SpecifierOver, Sdf.SpecifierClass, Sdf.SpecifierDef]))
    for root in ("/world", "/other"):
        make.beside = []
        _group(make, root, 3)
    for path in [prim.GetPath() for prim in stage.Traverse() if prim.HasAuthoredPayloads()]:
        if make.chance(2):
            stage.Unload(path)
    return stage


def _material(stage: Usd.Stage, path: str) -> None:
    """It reads primvars:p, so that each of its shapes does."""
    material, shader = UsdShade.Material.Define(stage, path), UsdShade.Shader.Define(stage, f"{path}/s")
    reader = UsdShade.Shader.Define(stage, f"{path}/r")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", _TYPES.String).Set("p")
    reader.CreateInput("fallback", _TYPES.Float3).Set(Gf.Vec3f(*FALLBACK))
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("emissiveColor", _TYPES.Color3f).ConnectToSource(reader.ConnectableAPI(), "result")
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")


def _group(make: _Maker, path: str, depth: int, *, in_prototype: bool = False) -> list[str]:
    """A prim with others below; the paths of all, those inside native instances by their proxies."""
    r, prim = make.r, make.stage.DefinePrim(path, make.r.choice(GROUPS))
    paths = [path]
    for _ in range(r.randint(1, 3)):
        kind = r.random()
        if depth == 0 or kind < 0.35:
            leaf = make.stage.DefinePrim(make.path(path, "c"), r.choice(LEAVES))
            _author(make, leaf, [], in_prototype)
            paths.append(str(leaf.GetPath()))
            make.beside.append(str(leaf.GetPath()))
        elif kind < 0.55 and make.inside:
            paths += _instance(make, path, in_prototype)
        elif kind < 0.7:
            paths += _instancer(make, path, depth, in_prototype)
        else:
            paths += _group(make, make.path(path, "g"), depth - 1, in_prototype=in_prototype)
    if make.in_library and make.chance(8):
        payload = make.stage.DefinePrim(make.path(path, "y"), "Xform")
        payload.GetPayloads().AddInternalPayload(r.choice(make.in_library))
        _author(make, payload, [], in_prototype)
    if path.count("/") > 1 and make.chance(25):
        prim.SetSpecifier(r.choice([Sdf.SpecifierOver, Sdf.SpecifierClass]))
    _author(make, prim, paths, in_prototype)
    make.beside.append(path)
    return paths


def _instance(make: _Maker, above: str, in_prototype: bool) -> list[str]:
    k = make.r.randrange(len(make.inside))
    prim = make.stage.DefinePrim(make.path(above, "i"), make.r.choice(GROUPS))
    if make.chance(2):
        prim.GetReferences().AddInternalReference(f"/protos/proto{k}")
    else:  # of which relationships may lead out of the instance
        prim.GetInherits().AddInherit(f"/protos/proto{k}")
    prim.SetInstanceable(True)
    paths = [f"{prim.GetPath()}{inner}" for inner in make.inside[k]]
    _author(make, prim, paths, in_prototype)
    for _ in range(make.r.randint(0, 3)):
        paths += _alike(make, prim, make.path(above, "i"), make.inside[k])
    make.beside += paths
    return paths


def _alike(make: _Maker, first: Usd.Prim, path: str, inside: list[str]) -> list[str]:
    """Another instance with the same opinions elsewhere, of which the strengths of bindings may differ."""
    layer = make.stage.GetRootLayer()
    Sdf.CopySpec(layer, first.GetPath(), layer, Sdf.Path(path))
    prim = make.stage.GetPrimAtPath(path)
    prim.CreateAttribute("xformOp:translate", _TYPES.Double3, False).Set(Gf.Vec3d(*_numbers(make)))
    prim.CreateAttribute("xformOpOrder", _TYPES.TokenArray, False, Sdf.VariabilityUniform).Set(["xformOp:translate"])
    for relationship in prim.GetAuthoredRelationships():
        if relationship.GetName().startswith("material:binding") and make.chance(3):
            weaker = relationship.GetMetadata("bindMaterialAs") is not None
            relationship.SetMetadata("bindMaterialAs", "weakerThanDescendants" if weaker else "strongerThanDescendants")
    return [f"{path}{inner}" for inner in inside]


def _instancer(make: _Maker, above: str, depth: int, in_prototype: bool) -> list[str]:
    r, instancer = make.r, UsdGeom.PointInstancer.Define(make.stage, make.path(above, "n"))
    prim, count = instancer.GetPrim(), make.r.randint(1, 3)
    path = str(prim.GetPath())
    beside = list(make.beside)
    paths = [path, *_group(make, make.path(path, "g"), min(depth - 1, 1), in_prototype=True)]
    roots = [paths[1] if make.chance(2) else r.choice(paths[1:])]
    if make.chance(1.5):
        roots.append(r.choice(beside[-20:] + [p for p in make.in_library if p.count("/") > 1] + roots))
    for root in roots:
        instancer.CreatePrototypesRel().AddTarget(root)
    instancer.CreateProtoIndicesAttr([r.randrange(len(set(roots))) for _ in range(count)])
    instancer.CreatePositionsAttr([Gf.Vec3f(*_numbers(make)) for _ in range(count)])
    for name in ("displayColor", "p"):
        if make.chance(3):
            _primvar(prim, name, [make.color() for _ in range(count)], "vertex")
    _author(make, prim, [], in_prototype)
    return paths


def _numbers(make: _Maker) -> tuple[int, int, int]:
    return (make.r.randint(-50, 50), make.r.randint(-50, 50), make.r.randint(-50, 50))


def _author(make: _Maker, prim: Usd.Prim, below: list[str], in_prototype: bool) -> None:
    """Opinions of every kind, also where its type has no use for them."""
    r, path = make.r, str(prim.GetPath())
    if make.chance(15):
        prim.CreateAttribute("visibility", _TYPES.Token, False).Set(r.choice(["invisible", "inherited"]))
    if make.chance(10):
        purpose = r.choice(["render", "proxy", "guide"])
        prim.CreateAttribute("purpose", _TYPES.Token, False, Sdf.VariabilityUniform).Set(purpose)
    if make.chance(15):
        prim.ApplyAPI(UsdGeom.VisibilityAPI)
        opinion = r.choice(["invisible", "visible", "inherited"])
        prim.CreateAttribute("renderVisibility", _TYPES.Token, False, Sdf.VariabilityUniform).Set(opinion)
    if make.chance(30) and path.count("/") > 1:
        prim.SetActive(False)
    _transform(make, prim, may_reset=not in_prototype)
    _model(make, prim)
    for name in ("displayColor", "p"):
        if make.chance(3) and not prim.HasAttribute(f"primvars:{name}"):
            _any_primvar(make, prim, name)
    _bind(make, prim, below)
    if make.color_spaces and make.chance(6):
        prim.ApplyAPI(Usd.ColorSpaceAPI)
        space = r.choice(["lin_ap1_scene", "srgb_rec709_scene", "lin_rec709_scene"])
        prim.CreateAttribute("colorSpace:name", _TYPES.Token, False, Sdf.VariabilityUniform).Set(space)


def _transform(make: _Maker, prim: Usd.Prim, *, may_reset: bool) -> None:
    if not make.chance(1.5):
        return
    order = ["xformOp:translate"]
    prim.CreateAttribute("xformOp:translate", _TYPES.Double3, False).Set(Gf.Vec3d(*_numbers(make)))
    if make.chance(3):
        prim.CreateAttribute("xformOp:scale", _TYPES.Double3, False).Set(Gf.Vec3d(make.r.choice([1, 2, 4]), 1, 2))
        order.append("xformOp:scale")
    if may_reset and make.chance(12):
        order.insert(0, "!resetXformStack!")
    prim.CreateAttribute("xformOpOrder", _TYPES.TokenArray, False, Sdf.VariabilityUniform).Set(order)


def _model(make: _Maker, prim: Usd.Prim) -> None:
    r = make.r
    if make.chance(2):
        prim.SetKind(r.choice(["group", "group", "group", "assembly", "component", "subcomponent", "unheard"]))
    if make.chance(8):
        mode = r.choice(["origin", "origin", "default", "inherited"])
        prim.CreateAttribute("model:drawMode", _TYPES.Token, False, Sdf.VariabilityUniform).Set(mode)
    if make.chance(8):
        prim.ApplyAPI(UsdGeom.ModelAPI)
        applied = r.choice([True, False])
        prim.CreateAttribute("model:applyDrawMode", _TYPES.Bool, False, Sdf.VariabilityUniform).Set(applied)


def _any_primvar(make: _Maker, prim: Usd.Prim, name: str) -> None:
    kind = make.r.random()
    if kind < 0.55:
        _primvar(prim, name, [make.color()], "constant")
    elif kind < 0.75:
        _primvar(prim, name, [make.color(), make.color()], "vertex")
    elif kind < 0.9:
        _primvar(prim, name, [], "constant").Block()
    else:
        prim.CreateAttribute(f"primvars:{name}", _TYPES.String).Set("no colour")


def _primvar(prim: Usd.Prim, name: str, values: list[tuple[float, float, float]], interpolation: str) -> Usd.Attribute:
    kind = _TYPES.Color3fArray if name == "displayColor" else _TYPES.Float3Array
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, kind, interpolation)
    primvar.Set([Gf.Vec3f(*value) for value in values])
    return primvar.GetAttr()


def _bind(make: _Maker, prim: Usd.Prim, below: list[str]) -> None:
    """Directly and, of what is `below`, by collections; for purposes, with strengths."""
    r = make.r
    for purpose in ("", ":full", ":preview"):
        if make.chance(4 if not purpose else 10):
            _bound(make, prim, f"material:binding{purpose}", [f"/m{r.randrange(MATERIALS)}"])
    if make.collections and len(below) > 1 and make.chance(5):
        name = f"k{make.count}"
        api = Usd.CollectionAPI.Apply(prim, name)
        if make.chance(4):
            some = r.choice(below).rpartition("/")[2]
            api.CreateMembershipExpressionAttr(Sdf.PathExpression(f"{prim.GetPath()}//{some}//"))
        else:
            for path in r.sample(below, min(r.randint(1, 3), len(below))):
                api.CreateIncludesRel().AddTarget(path)
            if make.chance(3):
                api.CreateExcludesRel().AddTarget(r.choice(below))
            if make.chance(4):
                api.CreateExpansionRuleAttr(Usd.Tokens.explicitOnly)
        purpose = ":full" if make.chance(4) else ""
        targets = [f"{prim.GetPath()}.collection:{name}", f"/m{r.randrange(MATERIALS)}"]
        _bound(make, prim, f"material:binding:collection{purpose}:{name}", targets)


def _bound(make: _Maker, prim: Usd.Prim, name: str, targets: list[str]) -> None:
    prim.ApplyAPI(UsdShade.MaterialBindingAPI)
    relationship = prim.CreateRelationship(name, False)
    relationship.SetTargets([Sdf.Path(target) for target in targets])
    if make.chance(3):
        relationship.SetMetadata("bindMaterialAs", UsdShade.Tokens.strongerThanDescendants)
