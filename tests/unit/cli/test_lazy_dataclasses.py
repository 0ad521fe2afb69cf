"""Dataclasses of commands beside the standard library's: the same methods, signatures and errors, all of our classes over."""

from __future__ import annotations

import dataclasses
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any
from unittest import mock

import pytest

from primray.cli import lazy_dataclasses
from primray.cli.lazy_dataclasses import lazy_dataclass

# Prints, for each of our dataclasses, what it looks like from outside.
LIST_ALL = """
import dataclasses, importlib, inspect, json, pkgutil, re, sys
if sys.argv[1] == "lazy":
    from primray.cli import lazy_dataclasses
    lazy_dataclasses.install()
import primray
lazy, facts = 0, {}
for module in sorted(m.name for m in pkgutil.walk_packages(primray.__path__, "primray.")):
    if module.rpartition(".")[2].startswith(("_core", "test", "pytest")):
        continue
    try:
        found = vars(importlib.import_module(module))
    except ModuleNotFoundError:
        continue  # an extra that is not installed
    for name, cls in sorted(found.items()):
        if not (isinstance(cls, type) and dataclasses.is_dataclass(cls) and cls.__module__ == module):
            continue
        lazy += type(vars(cls).get("__init__")).__name__ == "_Lazy"
        facts[f"{module}.{name}"] = [
            re.sub(" at 0x[0-9a-f]+", "", str(inspect.signature(cls))),
            [(f.name, str(f.type), f.init, f.repr, f.compare, f.hash, f.kw_only) for f in dataclasses.fields(cls)],
            cls.__hash__ is None,
            *(getattr(cls, method) is not getattr(object, method) for method in ("__eq__", "__repr__", "__hash__")),
            cls.__setattr__ is not object.__setattr__,
            cls.__match_args__,
        ]
print(json.dumps([lazy, facts]))
"""


def all_of_ours(how: str) -> tuple[int, dict[str, Any]]:
    environment = os.environ | {"PYTHONHASHSEED": "0"}
    done = subprocess.run([sys.executable, "-c", LIST_ALL, how], capture_output=True, text=True, check=True, env=environment)
    lazy, facts = json.loads(done.stdout.splitlines()[-1])
    return lazy, facts


def test_all_of_our_dataclasses_are_those_of_the_standard_library() -> None:
    (none, eager), (many, lazy) = all_of_ours("eager"), all_of_ours("lazy")
    assert lazy == eager
    assert len(eager) > 300
    assert none == 0
    assert many > 50  # those that importing them all did not use yet


def both(**options: bool) -> list[Callable[[type], type]]:
    return [dataclasses.dataclass(**options), lambda cls: lazy_dataclass(cls, **options)]  # type: ignore[call-overload]


@pytest.fixture(autouse=True)
def _classes_of_tests_are_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lazy_dataclasses, "OURS", (__name__,))


def outcome(act: Callable[[], object]) -> str:
    try:
        return repr(act())
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def seen(decorate: Callable[[type], type], own: str) -> list[str]:
    """Return what a class that is decorated so does."""

    class Lamp:
        watts: float
        name: str = "lamp"
        tags: list[str] = dataclasses.field(default_factory=list, compare=False)
        made: int = dataclasses.field(default=0, init=False, repr=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "made", int(self.watts))

    if own:
        setattr(Lamp, own, {"__eq__": lambda a, b: True, "__hash__": lambda a: 7, "__repr__": lambda a: "mine"}[own])
    make: Any = decorate(Lamp)
    one = make(watts=60.0)
    acts: list[Callable[[], object]] = [
        lambda: make(watts=60.0),
        lambda: make(60.0, "b", tags=["x"]),
        lambda: make(),
        lambda: make(watts=1, watt=2),
        lambda: (one == make(watts=60.0), one == make(watts=61.0), one == 3),
        lambda: hash(one) == hash(make(watts=60.0)),
        lambda: setattr(one, "watts", 3),
        lambda: delattr(one, "name"),
        lambda: setattr(one, "other", 3),
        lambda: dataclasses.replace(one, watts=5.0).made,
        lambda: dataclasses.astuple(one),
        lambda: make.__hash__ is None,
        lambda: make.__match_args__,
        lambda: make(watts=1.0).tags is make(watts=1.0).tags,
    ]
    return [outcome(act).partition(" at 0x")[0] for act in acts]


@pytest.mark.parametrize("options", [{}, {"frozen": True}, {"eq": False}, {"frozen": True, "eq": False}, {"kw_only": True}])
@pytest.mark.parametrize("own", ["", "__eq__", "__hash__", "__repr__"])
def test_a_class_behaves_as_the_standard_library_makes_it(options: dict[str, bool], own: str) -> None:
    eager, lazy = (seen(decorate, own) for decorate in both(**options))
    assert lazy == eager


def test_methods_are_made_when_they_are_used_and_fields_are_inherited() -> None:
    @lambda cls: lazy_dataclass(cls, frozen=True)
    class Base:
        a: int = 1

    @lambda cls: lazy_dataclass(cls, frozen=True)
    class Derived(Base):  # type: ignore[misc, valid-type]
        b: int = 2

    assert type(vars(Derived)["__init__"]).__name__ == "_Lazy"
    one: Any = Derived(3, 4)  # type: ignore[call-arg]
    assert (one.a, one.b) == (3, 4)
    assert type(vars(Derived)["__init__"]).__name__ == "function"
    assert type(vars(Base)["__init__"]).__name__ == "_Lazy"
    assert repr(one).endswith("Derived(a=3, b=4)")
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'a'"):
        one.a = 5


with mock.patch.object(lazy_dataclasses, "OURS", (__name__,)):
    Pickled: Any = lazy_dataclass(type("Pickled", (), {"__annotations__": {"a": "int"}, "__module__": __name__}), frozen=True)


def test_they_are_pickled() -> None:
    assert type(vars(Pickled).get("__eq__")).__name__ == "_Lazy"
    assert pickle.loads(pickle.dumps(Pickled(3))) == Pickled(3)


def test_classes_of_other_packages_are_left_alone() -> None:
    cls = lazy_dataclass(type("Theirs", (), {"__annotations__": {"a": "int"}, "__module__": "collections"}))
    assert type(vars(cls)["__init__"]).__name__ == "function"
