"""Prims, attributes and connections of a layer that is made from a document; types and values are as usdMtlx writes them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from pxr import Gf, Sdf, Vt

from .document_marks import NOTES

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
Tokens = tuple[tuple[str, str], ...]  # token names, and the values that a node gives them
RAW = "raw"  # the colour space of data that is not converted
SHADERS = ("surfaceshader", "displacementshader", "volumeshader", "lightshader")
_VECTORS = {"color3": Gf.Vec3f, "color4": Gf.Vec4f, "vector2": Gf.Vec2f, "vector3": Gf.Vec3f, "vector4": Gf.Vec4f}
_ARRAYS = {"booleanarray": Vt.BoolArray, "integerarray": Vt.IntArray, "floatarray": Vt.FloatArray}


def name_of(element: Any) -> str:
    return identifier(element.getName())


def identifier(name: str) -> str:
    """Return a name as a USD identifier; namespaces are separated by two underscores."""
    made = re.sub(r"\W", "_", name.replace(":", "__"), flags=re.ASCII)
    return made if made and not made[0].isdigit() else f"_{made}"


def define(layer: Sdf.Layer, path: Sdf.Path, type_name: str = "") -> Sdf.PrimSpec:
    """Return the prim spec at a path, created together with its ancestors if it does not exist."""
    spec = layer.GetPrimAtPath(path)
    if not spec:
        parent = path.GetParentPath()
        above = layer.pseudoRoot if parent == Sdf.Path.absoluteRootPath else define(layer, parent)
        return Sdf.PrimSpec(above, path.name, Sdf.SpecifierDef, type_name)
    if type_name and not spec.typeName:
        spec.typeName = type_name
    return spec


def apply(prim: Sdf.PrimSpec, schemas: Sequence[str]) -> None:
    """Set a prim's API schemas, replacing any others."""
    listed = Sdf.TokenListOp()
    listed.prependedItems = list(schemas)
    prim.SetInfo("apiSchemas", listed)


def refer(prim: Sdf.PrimSpec, path: Sdf.Path) -> None:
    """Add a reference to another prim of the same layer."""
    reference = Sdf.Reference("", path)
    if reference not in prim.referenceList.prependedItems:
        prim.referenceList.prependedItems.append(reference)


def attribute(prim: Sdf.PrimSpec, name: str, type_name: Sdf.ValueTypeName, *, uniform: bool = False) -> Sdf.AttributeSpec:
    """Return the prim's attribute of that name, created if it does not exist."""
    spec = prim.attributes.get(name)
    if spec:
        return spec
    return Sdf.AttributeSpec(prim, name, type_name, Sdf.VariabilityUniform if uniform else Sdf.VariabilityVarying)


def typed_attribute(prim: Sdf.PrimSpec, name: str, mtlx_type: str) -> Sdf.AttributeSpec:
    """Return an attribute of a MaterialX type; types that USD lacks are tokens with a render type."""
    known = _T.Token if mtlx_type in SHADERS else _TYPES.get(mtlx_type)
    spec = attribute(prim, name, known or _T.Token)
    if known is None:
        spec.SetInfo("renderType", mtlx_type)
    return spec


def input_of(prim: Sdf.PrimSpec, element: Any) -> Sdf.AttributeSpec:
    """Return the input with an element's name and type."""
    return typed_attribute(prim, f"inputs:{name_of(element)}", element.getType())


def connect(spec: Sdf.AttributeSpec, source: Sdf.Path) -> None:
    """Connect an attribute to one source, replacing any others."""
    spec.connectionPathList.explicitItems = [source]


def set_value(spec: Sdf.AttributeSpec, element: Any, colors: bool, factor: float = 1.0, tokens: Tokens = ()) -> None:
    """Write an element's value times a factor, and its colour space if it may have one (`colors`).

    The space is written whatever the document's is: a space that a layer leaves out is inherited from the stage, on which a
    document must not depend. An element without a value gets a space only where it names one itself.
    """
    value = value_of(element, tokens)
    if value is not None:
        spec.default = value if factor == 1.0 or element.getType() == "filename" else value * factor
    if colors and (value is not None or element.hasColorSpace()):
        spec.SetInfo("colorSpace", space_of(element))


def space_of(element: Any) -> str:
    """Return the colour space of an element: that of the nearest scope that names one.

    "none" means that nothing is converted, and is the default of documents (specification of MaterialX, "MTLX File Format
    Definition"); USD's name for it is raw.
    """
    space = str(element.getActiveColorSpace())
    return space if space and space != "none" else RAW


def value_of(element: Any, tokens: Tokens = ()) -> Any:
    """Return an element's value, None where it has none, or one that does not match its type."""
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
    """Return a file or geometry name with its prefix and its tokens resolved: `tokens` before those in scope."""
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
    """Store messages on a prim, to be reported when a material that contains it is translated."""
    if lines := list(dict.fromkeys(messages)):
        attribute(prim, NOTES, _T.StringArray, uniform=True).default = Vt.StringArray(lines)


def note_ui(spec: Sdf.Spec, element: Any) -> None:
    """Write an element's documentation."""
    if text := element.getAttribute("doc"):
        spec.SetInfo("documentation", text)


def note_input_ui(spec: Sdf.AttributeSpec, element: Any) -> None:
    """Write an input's documentation, enumeration values and display names."""
    if text := element.getAttribute("helptext"):
        spec.SetInfo("documentation", text)
    if names := element.getAttribute("enum"):
        spec.SetInfo("allowedTokens", Vt.TokenArray([name.strip() for name in names.split(",") if name.strip()]))
    if folder := element.getAttribute("uifolder"):
        spec.SetInfo("displayGroup", folder.replace("/", ":"))
    if shown := element.getAttribute("uiname"):
        spec.SetInfo("displayName", shown)
    note_ui(spec, element)
