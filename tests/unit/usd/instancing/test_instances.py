"""Flattening: products in double, shared groups, cycles, limits."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import world_from_prototype

from primray.description.placement import MatrixInstances, chunks
from primray.errors import LimitError
from primray.settings import RenderSettings
from primray.usd import camera_paths
from primray.usd.instancing.instances import Arrangement, Group, arrange, count_of

from ..usd_text import stage_of, translate_text

rng = np.random.default_rng(5)


def matrices(count: int) -> np.ndarray:
    return rng.normal(size=(count, 3, 4))


def square(upper: np.ndarray) -> np.ndarray:
    return np.concatenate([upper, np.broadcast_to([0.0, 0, 0, 1], (len(upper), 1, 4))], axis=1)


def level(matrices: np.ndarray) -> MatrixInstances:
    return MatrixInstances(matrices)


def standing(where: Arrangement, g: int) -> np.ndarray:
    """(K, 3, 4): where a group stands in the world."""
    return np.concatenate([rows for chain in where.world.get(g, []) for rows in chunks(chain)] or [np.zeros((0, 3, 4))])


def with_leaves(count: int) -> list[Group[str]]:
    return [Group(f"/{k}", ["leaf"]) for k in range(count)]


def test_a_group_reached_on_two_ways() -> None:
    a, b, ab, bc, ac = (matrices(n) for n in (2, 3, 4, 2, 5))
    groups = with_leaves(4)
    groups[0].instances = [(3, level(a)), (2, level(b))]
    groups[3].instances = [(1, level(ac)), (2, level(ab))]
    groups[2].instances = [(1, level(bc))]
    where = arrange(groups, None)
    assert where.cyclic == []
    assert where.inside == {}
    all_b = np.concatenate([(square(a)[:, None] @ square(ab)[None]).reshape(-1, 4, 4), square(b)])
    all_c = [(square(a)[:, None] @ square(ac)[None]).reshape(-1, 4, 4), (all_b[:, None] @ square(bc)[None]).reshape(-1, 4, 4)]
    for found, expected in (
        (standing(where, 3), square(a)),
        (standing(where, 2), all_b),
        (standing(where, 1), np.concatenate(all_c)),
    ):
        assert found.shape == (len(expected), 3, 4)
        order = np.lexsort(found.reshape(len(found), -1).T), np.lexsort(expected[:, :3].reshape(len(expected), -1).T)
        assert np.allclose(found[order[0]], expected[order[1], :3], rtol=1e-13)


def test_cycles_are_cut_and_named() -> None:
    groups = with_leaves(3)
    groups[0].instances = [(1, level(matrices(1)))]
    groups[1].instances = [(2, level(matrices(2)))]
    groups[2].instances = [(1, level(matrices(3))), (2, level(matrices(1)))]
    where = arrange(groups, None)
    assert where.cyclic == [(2, 1), (2, 2)]
    assert [len(standing(where, g)) for g in range(3)] == [1, 1, 2]


def test_a_million_million_instances_are_kept_in_two_levels() -> None:
    groups = [Group[str](f"/{k}") for k in range(5)]
    groups[4].leaves = ["leaf"]
    for k in range(4):
        groups[k].instances = [(k + 1, level(np.zeros((1000, 3, 4))))]
    where = arrange(groups, 10**9)
    assert list(where.inside) == [2]
    assert [count_of(c) for c in (*where.top[2], *where.inside[2][4])] == [10**6, 10**6]


def test_more_than_two_levels_can_hold_are_refused_before_they_are_made() -> None:
    groups = [Group[str](f"/{k}") for k in range(7)]
    groups[6].leaves = ["leaf"]
    for k in range(6):
        groups[k].instances = [(k + 1, level(np.zeros((1000, 3, 4))))]
    with pytest.raises(LimitError, match="instances") as error:
        arrange(groups, 10**9)
    assert (error.value.code, error.value.where) == ("memory-limit", "/3")


def test_far_away_nested_instances_keep_double_precision() -> None:
    text = """over "lib"
{
    def PointInstancer "p"
    {
        rel prototypes = </lib/ball>
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (0.25, 0, 0)]
    }
    def Sphere "ball"
    {
    }
}
def Xform "far" (
    instanceable = true
    references = </lib>
)
{
    double3 xformOp:translate = (100000000.125, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    description, _ = translate_text(text)
    (placement,) = description.placements
    x = sorted(world_from_prototype(placement)[:, 0, 3].tolist())
    assert x[-2:] == [100000000.125, 100000000.375]


def test_memory_limit_reaches_translation() -> None:
    text = 'def PointInstancer "p"\n{\n    rel prototypes = </p/s>\n    int[] protoIndices = [0, 0, 0]\n'
    text += '    point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]\n    def Sphere "s"\n    {\n    }\n}\n'
    with pytest.raises(LimitError):
        translate_text(text, RenderSettings(max_memory_bytes=100))


def test_paths_are_those_of_the_first_instance() -> None:
    text = 'over "lib"\n{\n    def Cone "c"\n    {\n    }\n}\n'
    text += "".join(f'def Xform "{n}" (\n    instanceable = true\n    references = </lib>\n)\n{{\n}}\n' for n in ("one", "two"))
    description, found = translate_text(text)
    assert [p.path for p in description.prototypes] == ["/one"]
    assert [s.path for s in description.shapes] == ["/one/c"]
    assert ("tessellated", "/one/c") in found


def test_camera_paths() -> None:
    assert camera_paths(stage_of('def Camera "a"\n{\n}\ndef Xform "x"\n{\n    def Camera "b"\n    {\n    }\n}\n')) == [
        "/a",
        "/x/b",
    ]


def test_diagnostics_inside_prototypes_name_the_first_instance() -> None:
    text = 'over "lib"\n{\n    def Sphere "s"\n    {\n        double radius = inf\n    }\n}\n'
    text += "".join(f'def Xform "{n}" (\n    instanceable = true\n    references = </lib>\n)\n{{\n}}\n' for n in ("one", "two"))
    assert ("wrong-type", "/one/s") in translate_text(text)[1]


def test_scopes_between_an_instancer_and_its_prototypes_hand_down_all_but_visibility() -> None:
    text = """def PointInstancer "p"
{
    rel prototypes = [</p/scope/a>, </p/scope/b>]
    int[] protoIndices = [0, 1]
    point3f[] positions = [(0, 0, 0), (1, 0, 0)]
    def Scope "scope"
    {
        token visibility = "invisible"
        uniform token purpose = "render"
        color3f[] primvars:displayColor = [(1, 0, 0)]
        def Sphere "a"
        {
        }
        def Sphere "b"
        {
            uniform token purpose = "guide"
        }
    }
}
"""
    description, _ = translate_text(text, RenderSettings(purposes=("render",)))
    assert [s.path for s in description.shapes] == ["/p/scope/a"]
    assert description.surfaces[0].diffuse_color == (1, 0, 0)
