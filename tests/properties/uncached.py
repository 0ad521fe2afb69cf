"""Translation that takes nothing to be alike: each instance is a group of its own, bound prim by prim, and no cache keeps
anything."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from primray.usd.materials.bound_materials import bind_shapes, bindings_of
from primray.usd.scene import walk
from primray.usd.scene.context import TranslationCaches

CACHES = frozenset(field.name for field in fields(TranslationCaches))


def without_caches(monkeypatch: pytest.MonkeyPatch) -> None:
    group = walk._Walk.group

    def forgetful(caches: TranslationCaches, name: str) -> Any:
        found = object.__getattribute__(caches, name)
        return type(found)() if name in CACHES else found

    def its_own(state: Any, root: Any, inherited: Any) -> int:
        state.index.clear()
        return group(state, root, inherited)

    monkeypatch.setattr(TranslationCaches, "__getattribute__", forgetful)
    monkeypatch.setattr(walk._Walk, "group", its_own)
    monkeypatch.setattr(walk, "bound_individually", lambda instances, ctx: [True] * len(instances))
    monkeypatch.setattr(walk, "bindings_of", lambda some, prototypes, by, ctx: bindings_of(some, prototypes, True, ctx))
    monkeypatch.setattr(walk, "bind_shapes", lambda shapes, by, ctx: bind_shapes(shapes, True, ctx))
