"""A context does not change; its caches, its findings and the surfaces that shapes have are shared by its copies."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import pytest
from pxr import Usd

from primray.description import Surface
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd.scene.context import Context
from primray.usd.stage.values import When


def context() -> Context:
    stage = Usd.Stage.CreateInMemory()
    return Context(stage, RenderSettings(), When(Usd.TimeCode.Default(), False), (), (), Diagnostics())


def test_it_does_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        context().names_instances = True  # type: ignore[misc]


def test_caches_and_findings_are_shared_by_copies_of_a_context_and_by_no_others() -> None:
    ctx = context()
    ctx.caches.holds_instancers["/a"] = True
    ctx.findings.portals.append("/b")
    copy = replace(ctx, names_instances=True)
    assert (copy.caches.holds_instancers, copy.findings.portals) == ({"/a": True}, ["/b"])
    assert (context().caches.holds_instancers, context().findings.portals) == ({}, [])


def test_equal_surfaces_have_one_index() -> None:
    surfaces = context().surfaces
    first, second = Surface("/a"), Surface("/b")
    assert [surfaces.index_of(s) for s in (first, second, Surface("/a"), first)] == [0, 1, 0, 0]
    assert list(surfaces) == [first, second]
