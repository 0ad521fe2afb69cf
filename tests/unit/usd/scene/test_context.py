"""A context does not change; what modules keep in it and the surfaces that shapes have are shared by its copies."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import pytest
from pxr import Usd

from primray.description import Surface
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd.scene.context import Context
from primray.usd.stage.values import When


class Numbers(dict[str, int]):
    pass


class OtherNumbers(dict[str, int]):
    pass


def context() -> Context:
    stage = Usd.Stage.CreateInMemory()
    return Context(stage, RenderSettings(), When(Usd.TimeCode.Default(), False), (), (), Diagnostics())


def test_it_does_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        context().names_instances = True  # type: ignore[misc]


def test_each_type_that_is_kept_is_one_object_in_all_copies() -> None:
    ctx = context()
    ctx.kept.of(Numbers)["a"] = 1
    assert replace(ctx, names_instances=True).kept.of(Numbers) == {"a": 1}
    assert ctx.kept.of(OtherNumbers) == {}
    assert context().kept.of(Numbers) == {}


def test_equal_surfaces_have_one_index() -> None:
    surfaces = context().surfaces
    first, second = Surface("/a"), Surface("/b")
    assert [surfaces.index_of(s) for s in (first, second, Surface("/a"), first)] == [0, 1, 0, 0]
    assert list(surfaces) == [first, second]
