"""What USD may fail to give, though the stage is open: values of another type than their schema's, damaged ones, text that is
not UTF-8. The only place for such calls (a gate holds that): each answers with a default, and `noting` hears of it.

Values are read as they are; whoever asks for one of a certain kind checks it (resolving.read).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any, TypeVar

from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade

from ...diagnostics import Diagnostics
from .messages import tf_message

# TypeError: of values that Python has no name for. RuntimeError: of what USD takes for expired.
FAILURES = (Tf.ErrorException, UnicodeDecodeError, TypeError, RuntimeError)
_heard: ContextVar[Diagnostics | None] = ContextVar("heard", default=None)

Value = TypeVar("Value")


@contextmanager
def noting(diagnostics: Diagnostics) -> Iterator[None]:
    """Failures inside become diagnostics of these; outside nobody hears of them."""
    before = _heard.set(diagnostics)
    try:
        yield
    finally:
        _heard.reset(before)


def note(code: str, path: str, message: str, name: str = "") -> None:
    if (diagnostics := _heard.get()) is not None:
        diagnostics.add(code, path, message, name)


def _failed(prim: Usd.Prim, name: str, error: Exception) -> None:
    note("wrong-type", _path_of(prim), f"{name or 'It'} cannot be read: {why(error)}", name)


def _path_of(prim: Usd.Prim) -> str:
    try:
        return str(prim.GetPath())
    except FAILURES:
        return ""


def _name_of(attribute: Usd.Property) -> str:
    try:
        return str(attribute.GetName())
    except FAILURES:
        return ""


def why(error: Exception) -> str:
    """What one of FAILURES says, as the end of a message."""
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8."
    return tf_message(error) if isinstance(error, Tf.ErrorException) else "USD has no such value for Python."


def value_at(attribute: Usd.Attribute, time: Usd.TimeCode | float) -> Any:
    """None where there is none, or none that can be read."""
    try:
        return attribute.Get(time)
    except FAILURES as error:
        _failed(attribute.GetPrim(), _name_of(attribute), error)
        return None


def default_value(attribute: Usd.Attribute) -> Any:
    """At the default time."""
    return value_at(attribute, Usd.TimeCode.Default()) if attribute else None


def metadatum(of: Usd.Object, name: str) -> Any:
    """Of a prim or property."""
    try:
        return of.GetMetadata(name)
    except FAILURES as error:
        _failed(of.GetPrim(), name, error)
        return None


def color_space_name(attribute: Usd.Attribute) -> str:
    """As the attribute's own metadata say, "" where they do not."""
    try:
        return str(attribute.GetColorSpace()) if attribute.HasColorSpace() else ""
    except FAILURES as error:
        _failed(attribute.GetPrim(), _name_of(attribute), error)
        return ""


def has_color_space(attribute: Usd.Attribute) -> bool:
    try:
        return bool(attribute.HasColorSpace())
    except FAILURES:
        return True  # what it is, its reader says


def interpolation(primvar: UsdGeom.Primvar) -> str:
    """`constant` where none is authored, and where it is no token."""
    try:
        return str(primvar.GetInterpolation())
    except FAILURES as error:
        _failed(primvar.GetAttr().GetPrim(), _name_of(primvar.GetAttr()), error)
        return "constant"


def normals_interpolation(shape: UsdGeom.PointBased) -> str:
    """Of `normals`, not of the primvar; `vertex` where none is authored, and where it is no token."""
    try:
        return str(shape.GetNormalsInterpolation())
    except FAILURES as error:
        _failed(shape.GetPrim(), "normals", error)
        return "vertex"


def element_size(primvar: UsdGeom.Primvar) -> int:
    try:
        return int(primvar.GetElementSize())
    except FAILURES as error:
        _failed(primvar.GetAttr().GetPrim(), _name_of(primvar.GetAttr()), error)
        return 1


def targets(prim: Usd.Prim, name: str) -> list[Sdf.Path]:
    """Where a relationship leads, through others; none where the property is an attribute."""
    relationship = prim.GetRelationship(name)
    if not relationship:
        if prim.HasProperty(name):
            note("wrong-type", _path_of(prim), f"{name} is no relationship.", name)
        return []
    try:
        return list(relationship.GetForwardedTargets())
    except FAILURES as error:
        _failed(prim, name, error)
        return []


def connections(attribute: Usd.Attribute) -> list[Sdf.Path]:
    try:
        return list(attribute.GetConnections()) if attribute.HasAuthoredConnections() else []
    except FAILURES as error:
        _failed(attribute.GetPrim(), _name_of(attribute), error)
        return []


def shader_id(shader: Usd.Prim) -> str:
    """ "" where it has none."""
    try:
        return str(UsdShade.Shader(shader).GetShaderId() or "")
    except FAILURES as error:
        _failed(shader, "info:id", error)
        return ""


def type_name(prim: Usd.Prim) -> str:
    """Return the name of the schema that USD takes a prim for; "" for a prim without a type.

    For types that no schema is known for, that is what the stage's `fallbackPrimTypes` name instead, else the authored name.
    """
    try:
        name: str = prim.GetTypeName()
        return name if not name or _is_schema(name) else _schema_name(prim.GetPrimTypeInfo())
    except FAILURES as error:
        _failed(prim, "typeName", error)
        return ""


@cache
def _is_schema(name: str) -> bool:
    return bool(Usd.SchemaRegistry.IsConcrete(name))


def _schema_name(info: Usd.PrimTypeInfo) -> str:
    name: str = info.GetSchemaTypeName() or info.GetTypeName()
    return name


def type_and_schemas(prim: Usd.Prim) -> tuple[str, list[str]]:
    """Return `type_name` of a prim and `schemas_applied` to it, in fewer questions."""
    try:
        info = prim.GetPrimTypeInfo()
        return _schema_name(info), info.GetAppliedAPISchemas()
    except FAILURES:
        return type_name(prim), schemas_applied(prim)


def schemas_applied(prim: Usd.Prim) -> list[str]:
    """Those that are authored on the prim, with instance names."""
    try:
        schemas: list[str] = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
        return schemas
    except FAILURES as error:
        _failed(prim, "apiSchemas", error)
        return []


def property_names(prim: Usd.Prim) -> list[str]:
    """Those that are authored."""
    try:
        names: list[str] = prim.GetAuthoredPropertyNames()
        return names
    except FAILURES as error:
        _failed(prim, "", error)
        return []


def authored_attributes(prim: Usd.Prim) -> list[Usd.Attribute]:
    """Where one of them cannot be told from a relationship, those that can."""
    try:
        return list(prim.GetAuthoredAttributes())
    except FAILURES:
        return [found for name in property_names(prim) if (found := _attribute(prim, name)) is not None]


def _attribute(prim: Usd.Prim, name: str) -> Usd.Attribute | None:
    try:
        found = prim.GetAttribute(name)
        return found if found and found.IsAuthored() else None
    except FAILURES as error:
        _failed(prim, name, error)
        return None


def local_transform(cache: UsdGeom.XformCache, prim: Usd.Prim) -> tuple[Gf.Matrix4d, bool]:
    """The prim's own, and whether it resets the stack; none at all where one of its operations cannot be read."""
    try:
        local, resets = cache.GetLocalTransformation(prim)
        return local, resets
    except FAILURES as error:
        return _no_transform(prim, error)


def local_transform_at(prim: Usd.Prim, time_of: Callable[[Usd.Attribute], Usd.TimeCode]) -> tuple[Gf.Matrix4d, bool]:
    """The same with a time for each of its operations."""
    local = Gf.Matrix4d(1.0)
    try:
        xformable = UsdGeom.Xformable(prim)
        if not xformable:
            return local, False
        for op in xformable.GetOrderedXformOps():  # least local first; row vectors: the most local multiplies from the left
            local = op.GetOpTransform(time_of(op.GetAttr())) * local
        return local, bool(xformable.GetResetXformStack())
    except FAILURES as error:
        return _no_transform(prim, error)


def _no_transform(prim: Usd.Prim, error: Exception) -> tuple[Gf.Matrix4d, bool]:
    note("wrong-type", _path_of(prim), f"No transform is used: {why(error)}", "xformOpOrder")
    return Gf.Matrix4d(1.0), False


def world_transform(cache: UsdGeom.XformCache, prim: Usd.Prim) -> Gf.Matrix4d | None:
    """None where that of one prim cannot be read, whose own reader says so."""
    return computed(lambda: cache.GetLocalToWorldTransform(prim), None)


def purpose_of(prim: Usd.Prim) -> str:
    """Its own or the nearest above it."""
    try:
        return str(UsdGeom.Imageable(prim).ComputePurpose())
    except FAILURES as error:
        _failed(prim, "purpose", error)
        return "default"


def is_invisible(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """By its own opinion or one above it."""
    try:
        return bool(UsdGeom.Imageable(prim).ComputeVisibility(time) == UsdGeom.Tokens.invisible)
    except FAILURES as error:
        _failed(prim, "visibility", error)
        return False


def computed(what: Callable[[], Value], default: Value) -> Value:
    """What USD computes of many prims, whose own readers say what is wrong with one."""
    try:
        return what()
    except FAILURES:
        return default
