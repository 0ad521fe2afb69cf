"""Dataclasses whose methods are made when they are first used, for the process of a command.

The standard library compiles up to six methods for each dataclass, 0.3 to 0.5 ms a class; a render imports 290 of them and
uses a third. `install` replaces `dataclasses.dataclass` by a decorator that finds the fields at once, and lets the standard
library make a method when it is first looked up. Classes of other packages than ours are left to the standard library.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, TypeVar

OURS = ("primray.", "primray_service.")
LAZY_OPTIONS = {"repr", "eq", "frozen", "kw_only"}

_Class = TypeVar("_Class", bound=type)
_eager: Any = dataclasses.dataclass


def install() -> None:
    """Make the methods of dataclasses lazily in this process, for modules that are imported from now on."""
    vars(dataclasses)["dataclass"] = _dataclass


def _dataclass(cls: type | None = None, /, **options: bool) -> Any:
    if cls is None:
        return lambda cls: lazy_dataclass(cls, **options)
    return lazy_dataclass(cls, **options)


def lazy_dataclass(cls: _Class, **options: bool) -> _Class:
    """Return the class as `dataclasses.dataclass` with these options does, but for when its methods are made."""
    if not cls.__module__.startswith(OURS) or not options.keys() <= LAZY_OPTIONS:
        plain: _Class = _eager(**options)(cls)
        return plain
    own = set(vars(cls))
    if cls.__doc__ is None:
        cls.__doc__ = cls.__name__  # or the standard library writes the signature, for which it needs __init__
    found: _Class = _eager(init=False, repr=False, eq=False, kw_only=options.get("kw_only", False))(cls)
    frozen, eq = options.get("frozen", False), options.get("eq", True)
    methods = ["__init__", *(["__repr__"] if options.get("repr", True) else []), *(["__eq__"] if eq else [])]
    if eq and frozen:
        methods.append("__hash__")
    elif eq and "__hash__" not in own:
        found.__hash__ = None  # type: ignore[method-assign, assignment]
    for name in methods:
        # A class that defines __eq__ without __hash__ has None there, which is not its own choice.
        if name not in own or (name == "__hash__" and vars(found)[name] is None and "__eq__" in own):
            setattr(found, name, _Lazy(found, name, frozen))
    if frozen:
        for name, refusal in zip(("__setattr__", "__delattr__"), _refusals(found), strict=True):
            setattr(found, name, refusal)
    return found


class _Lazy:
    """A method that replaces itself by the standard library's when it is looked up."""

    def __init__(self, cls: type, name: str, frozen: bool) -> None:
        self.cls, self.name, self.frozen = cls, name, frozen

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        method = _method(self.cls, self.name, self.frozen)
        setattr(self.cls, self.name, method)
        return method.__get__(instance, owner)


def _method(cls: type, name: str, frozen: bool) -> Any:
    """Return the method that the standard library makes for a class with the same fields."""
    fields = dataclasses.fields(cls)
    namespace: dict[str, Any] = {f.name: _same_field(f) for f in fields}
    # Annotations that are text are searched for ClassVar, and a class without documentation is documented by its signature.
    namespace |= {"__annotations__": dict.fromkeys(namespace, object), "__doc__": cls.__doc__}
    if hasattr(cls, "__post_init__"):
        namespace["__post_init__"] = cls.__post_init__
    made = {"__init__": "init", "__repr__": "repr", "__eq__": "eq", "__hash__": "eq"}[name]
    kinds = {kind: kind == made for kind in ("init", "repr", "eq")}
    twin: type = _eager(frozen=frozen and name in ("__init__", "__hash__"), **kinds)(type(cls.__name__, (), namespace))
    method = vars(twin)[name]
    if name == "__init__":
        method.__annotations__ = {f.name: f.type for f in fields if f.init} | {"return": None}
    method.__qualname__ = f"{cls.__qualname__}.{name}"
    method.__module__ = cls.__module__
    return method


def _same_field(f: dataclasses.Field[Any]) -> Any:
    options: dict[str, Any] = {"init": f.init, "repr": f.repr, "hash": f.hash, "compare": f.compare, "kw_only": f.kw_only}
    if f.default_factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=f.default_factory, **options)
    return dataclasses.field(default=f.default, **options)


def _refusals(cls: type) -> tuple[Callable[..., None], Callable[..., None]]:
    """Return __setattr__ and __delattr__ of a frozen class."""
    names = cls.__dataclass_fields__.keys()  # type: ignore[attr-defined]

    def __setattr__(self: object, name: str, value: object) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)  # type: ignore[arg-type]

    def __delattr__(self: object, name: str) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)  # type: ignore[arg-type]

    return __setattr__, __delattr__
