"""Reads that USD may fail, though the stage is open: values of another type than their schema's, damaged values, text that is
not UTF-8.

This is the only place for such calls (a gate holds that): each returns a default on failure, and reports it to `noting`. Values
are returned as they are; a caller that needs a certain kind checks it (values.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any, TypeVar

from pxr import Ar, Gf, Sdf, Tf, Usd, UsdGeom, UsdShade

from ...diagnostics import Diagnostics
from ...errors import AssetError
from ...read_files import note_read
from .messages import tf_message

# TypeError: a value of a type that Python does not have. RuntimeError: an object that USD considers expired.
FAILURES = (Tf.ErrorException, UnicodeDecodeError, TypeError, RuntimeError)
_heard: ContextVar[Diagnostics | None] = ContextVar("heard", default=None)

Value = TypeVar("Value")


@contextmanager
def noting(diagnostics: Diagnostics) -> Iterator[None]:
    """Report failures inside as diagnostics; outside of it they are not reported."""
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
    """Return the reason of one of FAILURES, as the end of a message."""
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8."
    return tf_message(error) if isinstance(error, Tf.ErrorException) else "its type has no Python equivalent."


def value_at(attribute: Usd.Attribute, time: Usd.TimeCode | float) -> Any:
    """Return the attribute's value at a time; None where there is none, or none that can be read."""
    try:
        return attribute.Get(time)
    except FAILURES as error:
        _failed(attribute.GetPrim(), _name_of(attribute), error)
        return None


def default_value(attribute: Usd.Attribute) -> Any:
    """Return the attribute's value at the default time."""
    return value_at(attribute, Usd.TimeCode.Default()) if attribute else None


def metadatum(of: Usd.Object, name: str) -> Any:
    """Return a piece of metadata of a prim or property."""
    try:
        return of.GetMetadata(name)
    except FAILURES as error:
        _failed(of.GetPrim(), name, error)
        return None


def color_space_name(attribute: Usd.Attribute) -> str:
    """Return the colour space in the attribute's own metadata, "" where none is authored."""
    try:
        return str(attribute.GetColorSpace()) if attribute.HasColorSpace() else ""
    except FAILURES as error:
        _failed(attribute.GetPrim(), _name_of(attribute), error)
        return ""


def has_color_space(attribute: Usd.Attribute) -> bool:
    try:
        return bool(attribute.HasColorSpace())
    except FAILURES:
        return True  # its reader reports what is wrong


def interpolation(primvar: UsdGeom.Primvar) -> str:
    """Return a primvar's interpolation; `constant` where none is authored, and where it is no token."""
    try:
        return str(primvar.GetInterpolation())
    except FAILURES as error:
        _failed(primvar.GetAttr().GetPrim(), _name_of(primvar.GetAttr()), error)
        return "constant"


def normals_interpolation(shape: UsdGeom.PointBased) -> str:
    """Return the interpolation of the attribute `normals` (not the primvar); `vertex` if not authored or no token."""
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
    """Return the forwarded targets of a relationship; none where the property is an attribute."""
    relationship = prim.GetRelationship(name)
    if not relationship:
        if prim.HasProperty(name):
            note("wrong-type", _path_of(prim), f"{name} is not a relationship.", name)
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
    """Return the shader's identifier, "" where it has none."""
    try:
        return str(UsdShade.Shader(shader).GetShaderId() or "")
    except FAILURES as error:
        _failed(shader, "info:id", error)
        return ""


def type_name(prim: Usd.Prim) -> str:
    """Return the schema name that USD uses for a prim; "" for a prim without a type.

    A type without a known schema is replaced by what the stage's `fallbackPrimTypes` name, if anything, else it is returned as
    authored.
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
    """Return `type_name` and `schemas_applied` of a prim, with fewer calls."""
    try:
        info = prim.GetPrimTypeInfo()
        return _schema_name(info), info.GetAppliedAPISchemas()
    except FAILURES:
        return type_name(prim), schemas_applied(prim)


def schemas_applied(prim: Usd.Prim) -> list[str]:
    """Return the API schemas authored on the prim, with instance names."""
    try:
        schemas: list[str] = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
        return schemas
    except FAILURES as error:
        _failed(prim, "apiSchemas", error)
        return []


def has_schema(prim: Usd.Prim, schema: str) -> bool:
    """Return whether an API schema is applied to the prim; a third faster than HasAPI."""
    try:
        return schema in prim.GetAppliedSchemas()
    except FAILURES as error:
        _failed(prim, "apiSchemas", error)
        return False


def property_names(prim: Usd.Prim) -> list[str]:
    """Return the names of the authored properties."""
    try:
        names: list[str] = prim.GetAuthoredPropertyNames()
        return names
    except FAILURES as error:
        _failed(prim, "", error)
        return []


def authored_attributes(prim: Usd.Prim) -> list[Usd.Attribute]:
    """Return the authored attributes; where one cannot be told from a relationship, all that can be read."""
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
    """Return the prim's local transform, and whether it resets the stack; identity where an operation cannot be read."""
    try:
        local, resets = cache.GetLocalTransformation(prim)
        return local, resets
    except FAILURES as error:
        return _no_transform(prim, error)


def local_transform_at(prim: Usd.Prim, time_of: Callable[[Usd.Attribute], Usd.TimeCode]) -> tuple[Gf.Matrix4d, bool]:
    """Return the prim's local transform with a separate time for each of its operations, and whether it resets the stack."""
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
    note("wrong-type", _path_of(prim), f"Its transform is ignored: {why(error)}", "xformOpOrder")
    return Gf.Matrix4d(1.0), False


def world_transform(cache: UsdGeom.XformCache, prim: Usd.Prim) -> Gf.Matrix4d | None:
    """Return the prim's world transform; None where one on the path cannot be read, which its own reader reports."""
    return computed(lambda: cache.GetLocalToWorldTransform(prim), None)


def purpose_of(prim: Usd.Prim) -> str:
    """Return the prim's purpose, or the nearest one above it."""
    try:
        return str(UsdGeom.Imageable(prim).ComputePurpose())
    except FAILURES as error:
        _failed(prim, "purpose", error)
        return "default"


def is_invisible(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Return whether the prim is invisible, by its own opinion or one above it."""
    try:
        return bool(UsdGeom.Imageable(prim).ComputeVisibility(time) == UsdGeom.Tokens.invisible)
    except FAILURES as error:
        _failed(prim, "visibility", error)
        return False


def computed(what: Callable[[], Value], default: Value) -> Value:
    """Return what USD computes from many prims, or the default where it fails; the reader of a faulty prim reports it."""
    try:
        return what()
    except FAILURES:
        return default


def read_asset(path: str, most: int | None = None) -> bytes:
    """Return the asset's bytes; raise AssetError if it cannot be opened, or is larger than `most` bytes."""
    note_read(path)
    try:
        asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    except Tf.ErrorException as error:  # such as a compressed member of a package
        message = f"the asset cannot be opened: {tf_message(error)}"
        raise AssetError(message, where=path, code="asset-missing") from None
    if not asset:
        raise AssetError("the asset cannot be opened", where=path, code="asset-missing")
    with asset as opened:
        if most is not None and opened.GetSize() > most:
            raise AssetError(f"the asset has {opened.GetSize()} bytes, more than {most}", where=path, code="asset-missing")
        buffer = opened.GetBuffer()
    return b"" if buffer is None else bytes(buffer)  # an empty file has no buffer
