"""Logged events become paths: vertices from the camera on, each once, whichever way the path was split, and their lights."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import pytest

from primray.report.logged_paths import MOST_VERTICES, LightPath, paths_of

ONE = (1.0, 1.0, 1.0)


class Numbered:
    """Shapes 0, 1, ... at /s0, /s1, ...; light 7 is the shape /s7; others are lights of their own."""

    def shape(self, event: Mapping[str, Any]) -> str:
        return f"/s{event['shape']}"

    def light(self, event: Mapping[str, Any]) -> tuple[str, bool]:
        if "dome" in event:
            return "/sky", True
        return ("/s7", False) if event["light"] == 7 else (f"/l{event['light']}", True)

    def is_light(self, path: str) -> bool:
        return False


class Log:
    """Events of a path, written down as the core does."""

    def __init__(self) -> None:
        self.events: list[dict[str, Any]] = []
        self.add("camera", 5, 0, 0, origin=(0.0, 0.0, 0.0), direction=(0.0, 0.0, -1.0))

    def add(self, kind: str, part: int, vertex: int, depth: int, **values: Any) -> None:
        self.events.append({"kind": kind, "sample": 0, "part": part, "vertex": vertex, "depth": depth, **values})

    def surface(self, part: int, depth: int, shape: int, *, diffuse: float = 1.0) -> None:
        self.add("hit", part, depth, depth, shape=shape, position=(float(shape), 0.0, 0.0))
        self.add("lobes", part, depth, depth, why="UsdPreviewSurface", diffuse=diffuse, specular=1 - diffuse)

    def scatter(self, part: int, depth: int, *, diffuse: float = 1.0, **flags: float) -> None:
        self.add("scatter", part, depth, depth, direction=(0.0, 1.0, 0.0), diffuse_share=(diffuse,) * 3, **flags)

    def paths(self) -> list[LightPath]:
        return list(paths_of(Numbered(), self.events))


def shown(path: LightPath) -> tuple[str, list[str], str]:
    return path.expression, [vertex.prim for vertex in path.way.vertices], path.light


def test_a_split_behind_a_mirror_keeps_the_mirror() -> None:
    log = Log()
    log.surface(5, 0, 1, diffuse=0.0)
    log.scatter(5, 0, diffuse=0.0, delta=1.0)
    log.surface(5, 1, 2)
    log.add("light sample", 10, 1, 1, light=0, contribution=ONE, direction=(0.0, 1.0, 0.0), distance=3.0)
    for part in (10, 11):  # two parts of path 5
        log.scatter(part, 1)
    for part in (11, 10):
        log.surface(part, 2, 3)
        log.add("light sample", part, 2, 2, light=1, contribution=ONE)
    paths = log.paths()
    assert [shown(path) for path in paths] == [
        ("C<.S>+<.D>+L", ["/s1", "/s2"], "/l0"),
        ("C<.S>+<.D>+L", ["/s1", "/s2", "/s3"], "/l1"),
        ("C<.S>+<.D>+L", ["/s1", "/s2", "/s3"], "/l1"),
    ]
    assert [path.sender for path in paths] == ["/l0", "/s3", "/s3"]
    assert paths[0].end == (2.0, 3.0, 0.0)


def test_the_last_ray_to_a_dome_has_each_vertex_once() -> None:
    log = Log()
    log.surface(5, 0, 1)
    log.scatter(5, 0)
    log.add("emission", 5, 1, 1, dome=0, radiance=ONE)
    log.add("dome ray", 5, 1, 1, direction=(0.0, 1.0, 0.0), contribution=ONE)
    assert [shown(path) for path in log.paths()] == [("C<.D>+L", ["/s1"], "/sky")]


@pytest.mark.parametrize("sampled", [True, False])
def test_a_surface_that_glows_is_one_however_it_is_found(sampled: bool) -> None:
    log = Log()
    log.surface(5, 0, 1)
    if sampled:
        log.add("light sample", 5, 0, 0, light=7, contribution=ONE)
    else:
        log.scatter(5, 0)
        log.add("hit", 5, 1, 1, shape=7, position=(0.0, 2.0, 0.0))
        log.add("emission", 5, 1, 1, radiance=ONE)
        log.add("gathered", 5, 1, 1, radiance=ONE, contribution=ONE)
    assert [shown(path) for path in log.paths()] == [("C<.D>+O", ["/s1"], "/s7")]


def test_lights_that_a_ray_meets_together_share_its_light() -> None:
    log = Log()
    log.add("emission", 5, 0, 0, dome=0, radiance=(1.0, 0.0, 3.0))
    log.add("emission", 5, 0, 0, light=2, radiance=(3.0, 0.0, 0.0))
    log.add("end", 5, 0, 0, contribution=(8.0, 0.0, 6.0))
    assert [(path.light, path.adds) for path in log.paths()] == [("/sky", (2.0, 0.0, 6.0)), ("/l2", (6.0, 0.0, 0.0))]


def test_what_light_passes_straight_through_is_no_vertex() -> None:
    log = Log()
    log.surface(5, 0, 1)
    log.scatter(5, 0, straight=1.0)
    log.add("hit", 5, 1, 0, shape=2, position=(2.0, 0.0, 0.0))  # no deeper
    log.add("lobes", 5, 1, 0, why="Lambert", diffuse=1.0)
    log.add("light sample", 5, 1, 0, light=0, contribution=ONE)
    assert [shown(path) for path in log.paths()] == [("C<.D>+L", ["/s2"], "/l0")]


def test_a_path_of_thousands_of_vertices_is_gone_through_once() -> None:
    log = Log()
    count = 20_000
    for depth in range(count):
        log.add("medium", 5, depth, depth, distance=1.0)
        log.add("lobes", 5, depth, depth, why="phase function")
        log.add("light sample", 5, depth, depth, light=0, contribution=ONE)
        log.scatter(5, depth)
    began = time.process_time()
    paths = log.paths()
    kinds = {(path.expression, path.light) for path in paths}
    longest = max(len(path.way.vertices) for path in paths)
    assert time.process_time() - began < 5  # half a second; minutes if each looked at all before
    assert kinds == {("CV+L", "/l0")}
    assert (len(paths), paths[-1].way.count, longest) == (count, count, MOST_VERTICES)
