"""Cameras inside native instances: listed and chosen by their proxies' paths, where their own instance stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd import camera_paths, translate
from primray.usd.camera.view import MOST_IN_INSTANCES, cameras_of
from primray.usd.inspect.scene_facts import scene_facts

from ..usd_text import stage_of, translate_text

MOVED = 'double3 xformOp:translate = ({}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
ASSETS = f"""
class "robot"
{{
    def Xform "head"
    {{
        {MOVED.format(100)}
        def Camera "eye"
        {{
            {MOVED.format(10)}
            double shutter:close = 1
        }}
        class "old"
        {{
            def Camera "eye"
            {{
            }}
        }}
    }}
}}
class "pair"
{{
    def Xform "left" (
        instanceable = true
        references = </robot>
    )
    {{
        {MOVED.format(1)}
    }}
    def Xform "right" (
        instanceable = true
        references = </robot>
    )
    {{
        {MOVED.format(2)}
    }}
}}
class "plain"
{{
    def Cube "c"
    {{
    }}
}}
"""


def instance(name: str, of: str, x: float) -> str:
    return f'def Xform "{name}" (\n    instanceable = true\n    references = </{of}>\n)\n{{\n    {MOVED.format(x)}\n}}\n'


ROBOTS = ASSETS + instance("b", "robot", 5000) + instance("rock", "plain", 0) + instance("a", "robot", 1000)


def test_the_first_in_the_order_of_the_stage_is_chosen_and_named() -> None:
    description, found = translate_text(ROBOTS)
    assert description.camera.path == "/b/head/eye"
    assert description.camera.world_from_camera[:3, 3].tolist() == [5110, 0, 0]
    assert ("camera-chosen", "/b/head/eye") in found
    assert camera_paths(stage_of(ROBOTS)) == ["/b/head/eye", "/a/head/eye"]


def test_each_is_asked_for_by_the_path_of_its_proxy() -> None:
    description, _ = translate_text(ROBOTS, RenderSettings(camera="/a/head/eye"))
    assert description.camera.world_from_camera[:3, 3].tolist() == [1110, 0, 0]
    with pytest.raises(SettingsError, match=r"Several cameras are called eye.*: /b/head/eye, /a/head/eye"):
        translate_text(ROBOTS, RenderSettings(camera="eye"))


def test_a_camera_outside_instances_comes_first() -> None:
    description, _ = translate_text(ROBOTS + 'def Camera "z"\n{\n}\n')
    assert description.camera.path == "/z"


def test_instances_in_instances() -> None:
    nested = ASSETS + instance("p", "pair", 5000) + instance("q", "pair", 7000)
    sides = [f"/{pair}/{side}/head/eye" for pair in "pq" for side in ("left", "right")]
    assert camera_paths(stage_of(nested)) == sides
    description, _ = translate_text(nested, RenderSettings(camera=sides[3]))
    assert description.camera.world_from_camera[:3, 3].tolist() == [7112, 0, 0]


def test_instances_that_do_not_stand_in_the_world_have_none() -> None:
    assert camera_paths(stage_of(ASSETS)) == []
    assert camera_paths(stage_of(ASSETS + instance("a", "robot", 0).replace("def", "class"))) == []
    assert camera_paths(stage_of(ASSETS + instance("a", "plain", 0))) == []


def test_very_many_are_cut_off() -> None:
    crowd = ASSETS + "".join(instance(f"r{k}", "robot", k) for k in range(MOST_IN_INSTANCES + 5))
    assert len(cameras_of(stage_of(crowd))) == MOST_IN_INSTANCES


def test_scene_facts_list_them(tmp_path: Path) -> None:
    path = tmp_path / "s.usda"
    path.write_text("#usda 1.0\n" + ROBOTS)
    facts = scene_facts(path).facts
    assert [camera["path"] for camera in facts["cameras"]] == ["/b/head/eye", "/a/head/eye"]
    assert facts["camera"] == "/b/head/eye"


def test_it_moves_as_its_instance_does() -> None:
    moving = ROBOTS.replace(
        "double3 xformOp:translate = (10, 0, 0)", "double3 xformOp:translate.timeSamples = { 0: (10, 0, 0), 1: (11, 0, 0) }"
    )
    found, _ = translate(stage_of(moving), RenderSettings(time_code=0.0))
    assert found.camera.path == "/b/head/eye"
    assert found.camera_motion is not None
    first, last = (camera.world_from_camera[:3, 3] for camera in found.camera_motion.cameras)
    assert last[0] - first[0] == 1
