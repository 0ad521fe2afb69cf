"""Prims, attributes and connections of a layer that is made from a document; types and values are as usdMtlx writes them.

Geometric properties that a document names (geompropdef) become nodes that read them: one of the geometry's own (geomprop =
position, normal, texcoord ...) in a space or with an index, or else the primvar of its name (MaterialX specification,
"GeomPropDef Elements").

An input's value is converted from its own unit to the one that the node's definition names, else to the scene unit of its type
(specification, "Units" and "NodeDef Input Elements"). The scene unit of distance is the stage's metersPerUnit; for every other
type it is the unit of scale 1, for angles degrees.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

from pxr import Gf, Sdf, Vt

from .document_marks import NOTES
from .documents import library

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
    return usd_identifier(element.getName())


def usd_identifier(name: str) -> str:
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


def set_schemas(prim: Sdf.PrimSpec, schemas: Sequence[str]) -> None:
    """Set a prim's API schemas, replacing any others."""
    listed = Sdf.TokenListOp()
    listed.prependedItems = list(schemas)
    prim.SetInfo("apiSchemas", listed)


def add_reference(prim: Sdf.PrimSpec, path: Sdf.Path) -> None:
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


def input_attribute(prim: Sdf.PrimSpec, element: Any) -> Sdf.AttributeSpec:
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


def write_messages(prim: Sdf.PrimSpec, messages: Iterable[str]) -> None:
    """Store messages on a prim, to be reported when a material that contains it is translated."""
    if lines := list(dict.fromkeys(messages)):
        attribute(prim, NOTES, _T.StringArray, uniform=True).default = Vt.StringArray(lines)


def write_documentation(spec: Sdf.Spec, element: Any) -> None:
    """Write an element's documentation."""
    if text := element.getAttribute("doc"):
        spec.SetInfo("documentation", text)


def write_input_documentation(spec: Sdf.AttributeSpec, element: Any) -> None:
    """Write an input's documentation, enumeration values and display names."""
    if text := element.getAttribute("helptext"):
        spec.SetInfo("documentation", text)
    if names := element.getAttribute("enum"):
        spec.SetInfo("allowedTokens", Vt.TokenArray([name.strip() for name in names.split(",") if name.strip()]))
    if folder := element.getAttribute("uifolder"):
        spec.SetInfo("displayGroup", folder.replace("/", ":"))
    if shown := element.getAttribute("uiname"):
        spec.SetInfo("displayName", shown)
    write_documentation(spec, element)


GEOMPROP_NODES = ("geompropvalue", "geompropvalueuniform")
_SETTINGS = {"space": "string", "index": "integer"}


class GeometricProperties:
    """Geometric properties of a document and of the standard library."""

    def __init__(self, document: Any) -> None:
        self._document = document
        self._own = {found.getName() for found in document.getChildren() if found.getCategory() == "geompropdef"}
        self._own = {name for name in self._own if document.getGeomPropDef(name).getAttribute("geomprop")}
        self.has_own = bool(self._own)

    def is_own(self, name: str) -> bool:
        """Return whether the document derives this property from another."""
        return name in self._own

    def write(self, prim: Sdf.PrimSpec, name: str, kind: str) -> None:
        """Make a prim the node that reads a property, as a value of type `kind` or of the property's own type."""
        found = self._document.getGeomPropDef(name)
        base = found.getAttribute("geomprop") if found is not None else ""
        kinds = [kind] if found is None else [kind, found.getType()]
        known = [f"ND_{base}_{k}" for k in kinds if base and library().getNodeDef(f"ND_{base}_{k}") is not None]
        if known:
            self._set_type(prim, known[0])
            expected = library().getNodeDef(known[0])
            for setting, setting_kind in _SETTINGS.items():
                text = found.getAttribute(setting)
                if text and expected.getActiveInput(setting) is not None:
                    value = int(text) if setting_kind == "integer" and text.isdecimal() else text
                    typed_attribute(prim, f"inputs:{setting}", setting_kind).default = value
        else:
            self._set_type(prim, f"ND_geompropvalue_{kinds[-1]}")
            typed_attribute(prim, "inputs:geomprop", "string").default = base or name

    def _set_type(self, prim: Sdf.PrimSpec, identifier: str) -> None:
        Sdf.AttributeSpec(prim, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform).default = identifier
        typed_attribute(prim, "outputs:out", identifier.rsplit("_", 1)[1])


_TYPES_WITH_UNITS = (
    "float",
    "vector2",
    "vector3",
    "vector4",
    "floatarray",
    "vector2array",
    "vector3array",
    "vector4array",
    "filename",
)
_DISTANCE = "distance"


class UnitError(Exception):
    """A unit that cannot be converted; the message says why."""


class Units:
    """Units that a document and the standard library define, and the scene's."""

    def __init__(self, document: Any, meters_per_unit: float) -> None:
        self._meters_per_unit = meters_per_unit
        self._scales: dict[str, dict[str, float]] = {}
        for definition in document.getUnitDefs():
            scales = self._scales.setdefault(definition.getAttribute("unittype"), {})
            for unit in definition.getUnits():
                scales[unit.getName()] = _scale(unit.getAttribute("scale"))

    def factor(self, element: Any, expected: Any = None) -> float:
        """Return the factor for an element's value; UnitError where its unit has no meaning.

        `expected`: the input of that name in the node's definition, None where there is none.
        """
        unit = element.getAttribute("unit")
        if not unit:
            return 1.0
        defined_type = expected.getAttribute("unittype") if expected is not None else ""
        unit_type = element.getAttribute("unittype") or defined_type
        if element.getType() not in _TYPES_WITH_UNITS:
            raise UnitError(f"it has the unit {unit}, but is not a float, vector or file")
        if not unit_type:
            raise UnitError(f"it has the unit {unit}, but neither it nor its definition has a unittype")
        if defined_type and unit_type != defined_type:
            raise UnitError(f"its unittype is {unit_type}, but its definition's is {defined_type}")
        target = expected.getAttribute("unit") if expected is not None else ""
        own = self._size(unit, unit_type)
        return own / (self._size(target, unit_type) if target else self._scene_unit(unit_type))

    def _scene_unit(self, unit_type: str) -> float:
        return self._meters_per_unit if unit_type == _DISTANCE else 1.0

    def _size(self, unit: str, unit_type: str) -> float:
        """Return the size of a unit in units of scale 1."""
        scales = self._scales.get(unit_type)
        if scales is None:
            raise UnitError(f"its unittype {unit_type} is not defined")
        size = scales.get(unit, 0.0)
        if not (math.isfinite(size) and size > 0):
            raise UnitError(f"there is no unit {unit} of the type {unit_type}")
        return size


def _scale(text: str) -> float:
    """Return a unit's scale: 1 where it has none, 0 where it is not a number."""
    try:
        return float(text) if text else 1.0
    except ValueError:
        return 0.0
