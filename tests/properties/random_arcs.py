"""Random stages whose prims compose one another: references, payloads, inherits, specializes, variants, nested instances."""

from __future__ import annotations

import random

from pxr import Sdf, Usd

OF_ASSET, OF_STAGE = "ABC", "STUVWX"
NUMBERS = ("size", "radius", "user:x")
MOST_PRIMS = 400


def stage_of(r: random.Random) -> Usd.Stage:
    """Prims refer to prims below roots that come earlier, so that nothing contains itself."""
    asset, root = Sdf.Layer.CreateAnonymous("asset.usda"), Sdf.Layer.CreateAnonymous("root.usda")
    root.timeCodesPerSecond, asset.timeCodesPerSecond = 24, r.choice([12, 24])
    for layer, names in ((asset, OF_ASSET), (root, OF_STAGE)):
        paths: list[Sdf.Path] = []
        for name in names:
            _add_tree(layer, Sdf.Path(f"/{name}"), paths, r)
        for path in paths:
            if r.random() < 0.45:
                _compose(layer, path, paths, None if layer is asset else asset, r)
    stage = Usd.Stage.Open(root)
    prims = sum(1 for _ in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    return stage if prims <= MOST_PRIMS else stage_of(r)


def _add_tree(layer: Sdf.Layer, path: Sdf.Path, paths: list[Sdf.Path], r: random.Random) -> None:
    depth, spec = path.pathElementCount, Sdf.CreatePrimInLayer(layer, path)
    kinds = (Sdf.SpecifierDef, Sdf.SpecifierClass, Sdf.SpecifierOver)
    spec.specifier = r.choices(kinds, (70, 15, 15) if depth == 1 else (90, 0, 10))[0]
    if spec.specifier != Sdf.SpecifierOver:
        spec.typeName = r.choice(["Xform", "Cube", "Cube", "Sphere", "Scope"])
    spec.active = depth == 1 or r.random() > 0.1
    paths.append(path)
    _add_opinions(spec, r)
    for name in r.sample("pqr", r.randint(0, 4 - depth)) if depth < 3 else ():
        _add_tree(layer, path.AppendChild(name), paths, r)


def _add_opinions(spec: Sdf.PrimSpec, r: random.Random) -> None:
    for name in NUMBERS:
        if r.random() < 0.35 and name not in spec.properties:
            attribute = Sdf.AttributeSpec(spec, name, Sdf.ValueTypeNames.Double)
            if r.random() < 0.7:
                attribute.default = r.choice([*range(1, 9), Sdf.ValueBlock()])
            for time in r.sample(range(10), 2) if r.random() < 0.3 else ():
                spec.layer.SetTimeSample(attribute.path, time, float(r.randint(1, 9)))
    if r.random() < 0.2:
        target = spec.path.StripAllVariantSelections().AppendChild("p")
        Sdf.RelationshipSpec(spec, "user:to").targetPathList.Prepend(target)
        among = Sdf.AttributeSpec(spec, "user:among", Sdf.ValueTypeNames.PathExpression)
        among.default = Sdf.PathExpression(f".//q {target}/q")


def _compose(layer: Sdf.Layer, path: Sdf.Path, paths: list[Sdf.Path], asset: Sdf.Layer | None, r: random.Random) -> None:
    spec = layer.GetPrimAtPath(path)
    spec.instanceable = r.random() < 0.5
    if r.random() < 0.15:
        spec.variantSetNameList.Prepend("look")
        spec.variantSelections["look"] = "one"
        variants = Sdf.VariantSetSpec(spec, "look")
        for name in ("one", "two"):
            variant = Sdf.VariantSpec(variants, name).primSpec
            _add_opinions(variant, r)
            _add_arc(variant, path, paths, asset, r)
    else:
        _add_arc(spec, path, paths, asset, r)


def _add_arc(spec: Sdf.PrimSpec, path: Sdf.Path, paths: list[Sdf.Path], asset: Sdf.Layer | None, r: random.Random) -> None:
    offset = Sdf.LayerOffset(r.choice([0, 0, 3]), r.choice([1, 1, 2]))
    if asset is not None and r.random() < 0.3:
        spec.referenceList.Prepend(Sdf.Reference(asset.identifier, f"/{r.choice(OF_ASSET)}", offset))
        return
    others = [other for other in paths if str(other)[1] < str(path)[1] and other.pathElementCount <= r.choice([2, 3])]
    if not others:
        return
    to, arc = r.choice(others), r.choice(["references", "payload", "inherits", "specializes"])
    if arc == "references":
        spec.referenceList.Prepend(Sdf.Reference("", to, offset))
    elif arc == "payload":
        spec.payloadList.Prepend(Sdf.Payload("", to, offset))
    else:
        (spec.inheritPathList if arc == "inherits" else spec.specializesList).Prepend(to)
