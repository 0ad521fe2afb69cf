"""Matrices of prims, multiplied out together: the bits of USD's own products, one at a time."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from pxr import Gf

from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.scene import poses as module
from primray.usd.scene.poses import ROOT, Poses

from ..usd_text import stage_of

walk_module = sys.modules["primray.usd.scene.walk"]  # the package has a function of that name too


@pytest.mark.parametrize("together", [4, 1 << 14])
def test_products_have_the_bits_of_usds_own(together: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_TOGETHER", together)
    rng = np.random.default_rng(1)
    poses, expected, resets_of = Poses(), [Gf.Matrix4d(1.0)], []
    for i in range(60):
        local = Gf.Matrix4d(*rng.normal(size=16).tolist())
        above, resets = int(rng.integers(0, len(expected))), i % 7 == 6
        resets_of.append(resets)
        assert poses.add(local, above, resets=resets) == len(expected)
        expected.append(local if resets else local * expected[above])
    columns = np.array(expected).transpose(0, 2, 1)
    assert np.array_equal(poses.of(range(len(expected))), columns)
    assert np.array_equal(np.array([poses.at(i) for i in range(len(expected))]), columns)
    assert any(resets_of)


def test_what_is_added_later_counts_too() -> None:
    poses = Poses()
    assert np.array_equal(poses.of([ROOT, ROOT]), np.array([np.eye(4), np.eye(4)]))
    moved = poses.add(Gf.Matrix4d().SetTranslate(Gf.Vec3d(1, 2, 3)), ROOT)
    assert poses.of([moved])[0, :3, 3].tolist() == [1, 2, 3]


def test_a_chain_of_many() -> None:
    poses, at = Poses(), ROOT
    for _ in range(3000):
        at = poses.add(Gf.Matrix4d().SetTranslate(Gf.Vec3d(1, 0, 0)), at)
    assert poses.at(at)[0, 3] == poses.of([at])[0, 0, 3] == 3000


def test_what_is_taken_is_not_kept() -> None:
    poses = Poses()
    moved = poses.add(Gf.Matrix4d().SetTranslate(Gf.Vec3d(1, 2, 3)), ROOT)
    assert poses.taken([moved, ROOT])[:, :3, 3].tolist() == [[1, 2, 3], [0, 0, 0]]
    with pytest.raises(IndexError):
        poses.of([moved])


def test_usds_cache_of_transforms_may_be_let_go_at_any_prim(monkeypatch: pytest.MonkeyPatch) -> None:
    moved = 'double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n'
    nested = "".join(f'def Xform "x{i}"\n{{\n{moved}' for i in range(5)) + f'def Sphere "s"\n{{\n{moved}}}\n' + "}\n" * 5
    stage = stage_of(nested)
    kept, _ = translate(stage, RenderSettings())
    monkeypatch.setattr(walk_module, "FORGOTTEN_AFTER", 1)
    forgotten, _ = translate(stage, RenderSettings())
    assert kept.static[0].matrix[:3, 3].tolist() == [6, 12, 18]
    assert np.array_equal(kept.static[0].matrix, forgotten.static[0].matrix)
