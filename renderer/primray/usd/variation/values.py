"""Values of a config (numbers, texts, lists) as values of an attribute's type."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pxr import Gf, Sdf

from ...errors import SettingsError

CODE = "dataset-target"


def usd_value(value: Any, kind: Sdf.ValueTypeName, folder: Path, where: str) -> Any:
    """Return the value for an attribute of this type; relative files are those beside the config, in `folder`.

    SettingsError where the type has no such value.
    """
    if kind.isArray:
        items = value if _holds_lists(value) or kind.scalarType.defaultValue is None else _items(value, kind.scalarType)
        return kind.type.pythonClass([usd_value(item, kind.scalarType, folder, where) for item in items])
    default = kind.defaultValue
    try:
        return _scalar(value, default, folder)
    except (TypeError, ValueError, OverflowError):
        raise SettingsError(f"{value!r} is no value of an attribute of type {kind}", where=where, code=CODE) from None


def _holds_lists(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, list) for item in value)


def _items(value: Any, kind: Sdf.ValueTypeName) -> Sequence[Any]:
    """Return the items of an array: one value of a vector's type stands for an array of it."""
    if not isinstance(value, list):
        return [value]
    return [value] if _length(kind.defaultValue) == len(value) else value


def _length(default: Any) -> int:
    return len(default) if hasattr(default, "__len__") and not isinstance(default, str) else 1


def _scalar(value: Any, default: Any, folder: Path) -> Any:
    if isinstance(default, Sdf.AssetPath):
        if not isinstance(value, str):
            raise TypeError
        return Sdf.AssetPath(file_beside(value, folder))
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise TypeError
        return value
    if isinstance(default, str):
        if not isinstance(value, str):
            raise TypeError
        return value
    if isinstance(value, bool | str):
        raise TypeError
    if isinstance(default, int):
        if int(value) != value:
            raise ValueError
        return int(value)
    if isinstance(default, float):
        return float(value)
    if isinstance(default, Gf.Quatf | Gf.Quatd | Gf.Quath):
        real, *imaginary = map(float, value)
        return type(default)(real, *imaginary)
    if isinstance(default, Gf.Matrix4d | Gf.Matrix3d | Gf.Matrix2d):
        return type(default)(value)
    if len(value) != len(default):
        raise ValueError
    return type(default)(*value)


def file_beside(name: str, folder: Path) -> str:
    """Return the path of a file beside the config; URLs of other resolvers stay as they are."""
    return name if "://" in name else os.path.abspath(folder / name)
