"""Translation that takes nothing to be alike: each instance is a group of its own, bound prim by prim, and no cache keeps
anything."""

from __future__ import annotations

from typing import Any

import pytest

from primray.usd.instancing import prototypes
from primray.usd.lights import light_color, photometric
from primray.usd.materials.bound_materials import bind_shapes, bindings_of
from primray.usd.materials.material import MaterialCache
from primray.usd.materials.network import ShaderIds
from primray.usd.mesh import adapter
from primray.usd.mesh.authored import FacesByContent
from primray.usd.scene import bindings, color_spaces, inheritance, walk
from primray.usd.scene.context import Kept
from primray.usd.shapes import implicit

# What only saves work. All others that are kept are records, which later steps read.
CACHES = frozenset({
    MaterialCache, FacesByContent, ShaderIds, bindings._BindingFaults, color_spaces.ColorSpaceCache,
    light_color._Illuminants, implicit._Tessellations, adapter._Geometries, photometric._Amounts,
    prototypes._HoldInstancers, inheritance._Colored,
})  # fmt: skip


def without_caches(monkeypatch: pytest.MonkeyPatch) -> None:
    of, group = Kept.of, walk._Walk.group

    def forgetful(kept: Kept, kind: type[Any]) -> Any:
        return kind() if kind in CACHES else of(kept, kind)

    def its_own(state: Any, root: Any, inherited: Any) -> int:
        state.index.clear()
        return group(state, root, inherited)

    monkeypatch.setattr(Kept, "of", forgetful)
    monkeypatch.setattr(walk._Walk, "group", its_own)
    monkeypatch.setattr(walk, "bound_individually", lambda instances, ctx: [True] * len(instances))
    monkeypatch.setattr(walk, "bindings_of", lambda some, prototypes, by, ctx: bindings_of(some, prototypes, True, ctx))
    monkeypatch.setattr(walk, "bind_shapes", lambda shapes, by, ctx: bind_shapes(shapes, True, ctx))
