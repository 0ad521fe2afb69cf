"""Documents and networks of MaterialX with something wrong in them, made from good ones by a seed."""

from __future__ import annotations

import random
import re

GOOD = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="acescg" fileprefix="maps/">
  <nodedef name="ND_own" node="own"><input name="in" type="color3" value="1, 1, 1"/><output name="out" type="color3"/></nodedef>
  <nodegraph name="NG_own" nodedef="ND_own">
    <contrast name="c" type="color3"><input name="in" type="color3" interfacename="in"/></contrast>
    <output name="out" type="color3" nodename="c"/>
  </nodegraph>
  <nodegraph name="NG">
    <input name="by" type="float" value="0.5"/>
    <tiledimage name="image" type="color3">
      <input name="file" type="filename" value="a.png" colorspace="srgb_texture"/>
      <input name="uvtiling" type="vector2" value="2, 2"/>
    </tiledimage>
    <noise2d name="noise" type="float"><input name="amplitude" type="float" interfacename="by"/>
      <input name="pivot" type="float" value="2" unittype="distance" unit="inch"/></noise2d>
    <mix name="mixed" type="color3">
      <input name="fg" type="color3" nodename="image"/>
      <input name="mix" type="float" nodename="noise"/>
    </mix>
    <own name="own1" type="color3"><input name="in" type="color3" nodename="mixed"/></own>
    <output name="out" type="color3" nodename="own1"/>
  </nodegraph>
  <standard_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG" output="out"/>
    <input name="specular_roughness" type="float" value="0.25"/>
    <input name="opacity" type="color3" value="1, 1, 0.5"/>
  </standard_surface>
  <open_pbr_surface name="O" type="surfaceshader">
    <input name="geometry_opacity" type="float" nodename="top"/>
  </open_pbr_surface>
  <fractal3d name="top" type="float"/>
  <surfacematerial name="M" type="material"><input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
  <surfacematerial name="P" type="material"><input name="surfaceshader" type="surfaceshader" nodename="O"/>
    <input name="backsurfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
  <collection name="some" includegeom="/a//c*"/>
  <collection name="all" includegeom="/a, /b" includecollection="some" excludegeom="/{b,c}/d?"/>
  <variantset name="q" node="S"><variant name="r"><input name="base" type="float" value="0.5"/></variant></variantset>
  <propertyset name="p"><property name="matte" type="boolean" value="true"/></propertyset>
  <look name="base"><materialassign name="y" material="P" geom="/"/></look>
  <look name="L" inherit="base"><materialassign name="x" material="M" collection="all"/>
    <variantassign name="v" variantset="q" variant="r"/><propertysetassign name="ps" propertyset="p" geom="/c"/>
    <visibility name="vi" geom="//*" visible="false"/><visibility name="vj" geom="/c" visible="true"/></look>
  <lookgroup name="g" looks="base, L" default="L"/>
</materialx>
"""
STAGE = """#usda 1.0
def Scope "Looks" ( references = @looks.mtlx@</MaterialX/Materials> ) {}
def "Model" ( references = @looks.mtlx@</ModelRoot> ) {
    def Scope "c" {}
}
def Sphere "a" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
    rel material:binding = </Looks/M>
}
def Sphere "b" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
    rel material:binding = </Looks/P>
}
"""
STRANGE = [
    "", "0", "-1", "1e40", "nan", "inf", "1, 2", "a, b, c", "color4", "surfaceshader", "matrix44", "NG", "ND_own", "image",
    "out", "../../x", "/", "\u00e9\u4e2d", "a:b", "1a", "%s", "<UDIM>", "x" * 5000, "M", "S", "own", "mixed", "BSDF",
    "filename",
]  # fmt: skip
_TOKENS = re.compile(r"<[^<>]*>|[^<>]+")
_VALUES = re.compile(r'="[^"]*"')


def mutated(text: str, seed: int) -> str:
    """With one to four things changed: values, names, elements that are gone, twice, moved or cut short."""
    rng = random.Random(seed)
    for _ in range(rng.randint(1, 4)):
        text = rng.choice((_value, _value, _value, _swapped, _dropped, _twice, _moved, _cut, _bytes))(text, rng)
    return text


def _value(text: str, rng: random.Random) -> str:
    found = list(_VALUES.finditer(text))
    if not found:
        return text
    at = rng.choice(found)
    return f'{text[: at.start()]}="{rng.choice(STRANGE)}"{text[at.end() :]}'


def _swapped(text: str, rng: random.Random) -> str:
    values = [match[0] for match in _VALUES.finditer(text)]
    if not values:
        return text
    a, b = rng.choice(values), rng.choice(values)
    return text.replace(a, "\0").replace(b, a).replace("\0", b)


def _parts(text: str) -> list[str]:
    return _TOKENS.findall(text)


def _dropped(text: str, rng: random.Random) -> str:
    parts = _parts(text)
    del parts[rng.randrange(len(parts)) :][:1]
    if parts:
        parts.pop(rng.randrange(len(parts)))
    return "".join(parts)


def _twice(text: str, rng: random.Random) -> str:
    parts = _parts(text)
    at = rng.randrange(len(parts)) if parts else 0
    return "".join(parts[:at] + parts[at : at + 1] * rng.choice((2, 3, 200)) + parts[at + 1 :])


def _moved(text: str, rng: random.Random) -> str:
    parts = _parts(text)
    if parts:
        parts.insert(rng.randrange(len(parts)), parts.pop(rng.randrange(len(parts))))
    return "".join(parts)


def _cut(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text) + 1)] if rng.random() < 0.3 else text


def _bytes(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + chr(rng.choice((0, 9, 34, 60, 62, 38, 0xE9))) + text[at:]
