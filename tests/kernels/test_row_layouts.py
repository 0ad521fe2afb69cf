"""Rows of surfaces give the same bits from one row for all lanes, from rows by lane, and from columns."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import kernels
from tests.statistics.surfaces.open_pbr.open_pbr_cases import CASES, surface
from tests.statistics.surfaces.surface_cases import SURFACES

from primray.core.inputs import surface_input

COUNT = 4000
BY_LANE, BY_COLUMN = 1, 2
ALL = {name: surface(case) for name, case in CASES.items()} | {
    f"preview {name}": surface_input(s) for name, s in SURFACES.items()
}


def directions(rng: np.random.Generator) -> npt.NDArray[np.float32]:
    w = rng.normal(size=(COUNT, 3))
    return np.ascontiguousarray(w / np.linalg.norm(w, axis=1, keepdims=True), np.float32)


@pytest.mark.parametrize("layout", [BY_LANE, BY_COLUMN], ids=["by lane", "by column"])
@pytest.mark.parametrize("name", ALL)
def test_layouts_give_the_same_bits(name: str, layout: int) -> None:
    rng = np.random.default_rng(50)
    wo, wi = directions(rng), directions(rng)
    wo[:, 2] = np.abs(wo[:, 2])
    front = rng.integers(0, 2, COUNT).astype(np.int32)
    u = rng.random((COUNT, 3), dtype=np.float32)

    def results(**how: Any) -> list[npt.NDArray[Any]]:
        found = kernels()
        return [*found.bsdf_eval(ALL[name], wo, wi, front, **how), *found.bsdf_sample(ALL[name], wo, front, u, **how)]

    for one, other in zip(results(), results(layout=layout), strict=True):
        np.testing.assert_array_equal(one.view(np.int32), other.view(np.int32))
