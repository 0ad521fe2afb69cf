"""Prims, attributes and connections of a layer that is made of a document; types and values as usdMtlx has them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from pxr import Gf, Sdf, Vt

from ..querying.document_marks import NOTES

ROOT = Sdf.Path("/MaterialX")
_T = Sdf.ValueTypeNames
_TYPES = {
    "boolean": _T.Bool,
    "integer": _T.Int,
    "float": _T.Float,
    "color3": _T.Color3f,
    "color4": _T.Color4f,
    "vector2": _T.Float2,
    "vector3": _T.Float3,
    "vector4": _T.Float4,
    "matrix33": _T.Matrix3d,
    "matrix44": _T.Matrix4d,
    "string": _T.String,
    "filename": _T.Asset,
    "geomname": _T.String,
    "booleanarray": _T.BoolArray,
    "integerarray": _T.IntArray,
    "floatarray": _T.FloatArray,
    "color3array": _T.Color3fArray,
    "color4array": _T.Color4fArray,
    "vector2array": _T.Float2Array,
    "vector3array": _T.Float3Array,
    "vector4array": _T.Float4Array,
    "stringarray": _T.StringArray,
    "geomnamearray": _T.StringArray,
}
Tokens = tuple[tuple[str, str], ...]  # names and values that a node gives tokens of what implements it
RAW = "raw"  # the colour space of numbers that nothing converts
SHADERS = ("surfaceshader", "displacementshader", "volumeshader", "lightshader")
_VECTORS = {"color3": Gf.Vec3f, "color4": Gf.Vec4f, "vector2": Gf.Vec2f, "vector3": Gf.Vec3f, "vector4": Gf.Vec4f}
_ARRAYS = {"booleanarray": Vt.BoolArray, "integerarray": Vt.IntArray, "floatarray": Vt.FloatArray}


def name_of(element: Any) -> str:
    return identifier(element.getName())


def identifier(name: str) -> str:
    """A name as USD can have it; namespaces are set off by two underscores."""
    made = re.sub(r"\W", "_", name.replace(":", "__"), flags=re.ASCII)
    return made if made and not made[0].isdigit() else f"_{made}"


def define(layer: Sdf.Layer, path: Sdf.Path, type_name: str = "") -> Sdf.PrimSpec:
    """The prim of that path, made with all above it where it is not there."""
    spec = layer.GetPrimAtPath(path)
    if not spec:
        parent = path.GetParentPath()
        above = layer.pseudoRoot if parent == Sdf.Path.absoluteRootPath else define(layer, parent)
        return Sdf.PrimSpec(above, path.name, Sdf.SpecifierDef, type_name)
    if type_name and not spec.typeName:
        spec.typeName = type_name
    return spec


def apply(prim: Sdf.PrimSpec, schemas: Sequence[str]) -> None:
    """These API schemas and no others."""
    listed = Sdf.TokenListOp()
    listed.prependedItems = list(schemas)
    prim.SetInfo("apiSchemas", listed)


def refer(prim: Sdf.PrimSpec, path: Sdf.Path) -> None:
    """To another prim of the same layer."""
    reference = Sdf.Reference("", path)
    if reference not in prim.referenceList.prependedItems:
        prim.referenceList.prependedItems.append(reference)


def attribute(prim: Sdf.PrimSpec, name: str, type_name: Sdf.ValueTypeName, *, uniform: bool = False) -> Sdf.AttributeSpec:
    """The prim's attribute of that name, made where it is not there."""
    spec = prim.attributes.get(name)
    if spec:
        return spec
    return Sdf.AttributeSpec(prim, name, type_name, Sdf.VariabilityUniform if uniform else Sdf.VariabilityVarying)


def typed_attribute(prim: Sdf.PrimSpec, name: str, mtlx_type: str) -> Sdf.AttributeSpec:
    """Of a type of MaterialX's; what USD has no type for is a token with that render type."""
    known = _T.Token if mtlx_type in SHADERS else _TYPES.get(mtlx_type)
    spec = attribute(prim, name, known or _T.Token)
    if known is None:
        spec.SetInfo("renderType", mtlx_type)
    return spec


def input_of(prim: Sdf.PrimSpec, element: Any) -> Sdf.AttributeSpec:
    """The input of an element's name and type."""
    return typed_attribute(prim, f"inputs:{name_of(element)}", element.getType())


def connect(spec: Sdf.AttributeSpec, source: Sdf.Path) -> None:
    """To that source and no other."""
    spec.connectionPathList.explicitItems = [source]


def set_value(spec: Sdf.AttributeSpec, element: Any, colors: bool, factor: float = 1.0, tokens: Tokens = ()) -> None:
    """Write an element's value times a factor, and the colour space that it is in; `colors`: it may have one.

    The space is written whatever the document's is: what a layer leaves unsaid is the stage's to say, which a document is not
    to depend on. An element without a value says its space only where it says one itself.
    """
    value = value_of(element, tokens)
    if value is not None:
        spec.default = value if factor == 1.0 or element.getType() == "filename" else value * factor
    if colors and (value is not None or element.hasColorSpace()):
        spec.SetInfo("colorSpace", space_of(element))


def space_of(element: Any) -> str:
    """Return the space of an element's colours: that of the nearest scope which names one.

    "none" means that nothing is converted, and is what a document without a colour space has (specification of MaterialX,
    "MTLX File Format Definition"): USD's word for it is raw.
    """
    space = str(element.getActiveColorSpace())
    return space if space and space != "none" else RAW


def value_of(element: Any, tokens: Tokens = ()) -> Any:
    """None where there is none that its type can have."""
    kind = element.getType()
    text = _resolved_text(element, tokens) if kind in ("filename", "geomname") else element.getValueString()
    if not text:
        return None
    if kind == "filename":
        return Sdf.AssetPath(text)
    if kind in ("string", "geomname"):
        return text
    return _converted(element.getValue(), kind) if kind in _TYPES else None


def _resolved_text(element: Any, tokens: Tokens) -> str:
    """Return the name of a file or of geometry with its prefix, and with tokens filled in: these before those in scope."""
    if not tokens or "[" not in element.getValueString():
        return str(element.getResolvedValueString())
    resolver = element.createStringResolver()
    for name, text in tokens:
        resolver.setFilenameSubstitution(f"[{name}]", text)
    return str(element.getResolvedValueString(resolver))


def _converted(value: Any, kind: str) -> Any:
    if value is None:
        return None
    if kind in _VECTORS:
        return _VECTORS[kind](*value)
    if kind.startswith("matrix"):
        size = 3 if kind == "matrix33" else 4
        numbers = [value[row, column] for row in range(size) for column in range(size)]
        return Gf.Matrix3d(*numbers) if size == 3 else Gf.Matrix4d(*numbers)
    if kind.endswith("array"):
        return _array(value, kind)
    return value


def _array(values: Sequence[Any], kind: str) -> Any:
    if kind in ("stringarray", "geomnamearray"):
        return Vt.StringArray([str(x) for x in values])
    if kind in _ARRAYS:
        return _ARRAYS[kind](list(values))
    return None


def note(prim: Sdf.PrimSpec, messages: Iterable[str]) -> None:
    """Leave messages on a prim, for whoever translates what it becomes part of: what its document says and nothing does."""
    if lines := list(dict.fromkeys(messages)):
        attribute(prim, NOTES, _T.StringArray, uniform=True).default = Vt.StringArray(lines)


def note_ui(spec: Sdf.Spec, element: Any) -> None:
    """What only people read."""
    if text := element.getAttribute("doc"):
        spec.SetInfo("documentation", text)


def note_input_ui(spec: Sdf.AttributeSpec, element: Any) -> None:
    if text := element.getAttribute("helptext"):
        spec.SetInfo("documentation", text)
    if names := element.getAttribute("enum"):
        spec.SetInfo("allowedTokens", Vt.TokenArray([name.strip() for name in names.split(",") if name.strip()]))
    if folder := element.getAttribute("uifolder"):
        spec.SetInfo("displayGroup", folder.replace("/", ":"))
    if shown := element.getAttribute("uiname"):
        spec.SetInfo("displayName", shown)
    note_ui(spec, element)
