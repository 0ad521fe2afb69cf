"""Who is seen: prims that relationships lead to, whatever stands above them; cameras and settings in the world only."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd

from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import camera_paths, products, translate
from primray.usd.stage.edits import temporarily_defined
from primray.usd.stage.traversal import instanced_roots, is_in_world
from primray.usd.view_setup import find_by_type

from ..skinned_text import character
from ..usd_text import stage_of, translate_text

BOX = 'def Cube "box"\n{\n}\n'
ABOVE = ['class "L"', 'class Xform "L"', 'over "L"', 'def Xform "L"']


def instancer(name: str, prototype: str, places: str = "[(0, 0, 0)]") -> str:
    return f"""def PointInstancer "{name}"
{{
    rel prototypes = <{prototype}>
    int[] protoIndices = [{", ".join("0" for _ in range(places.count("(")))}]
    point3f[] positions = {places}
}}
"""


@pytest.mark.parametrize("above", ABOVE)
def test_shaders_and_skeletons_are_found_below_anything(above: str) -> None:
    found = find_by_type(stage_of(f'{above}\n{{\n def Shader "s"\n {{\n }}\n def SkelRoot "r"\n {{\n }}\n}}\n'), Diagnostics())
    assert [str(p.GetPath()) for p in (*found.shaders, *found.skeletons)] == ["/L/s", "/L/r"]


@pytest.mark.parametrize(
    "text",
    ['over "L"\n{{\n over "s"\n {{\n  {0}\n }}\n}}\n', 'def "L" (\n active = false\n)\n{{\n def "s"\n {{\n  {0}\n }}\n}}\n'],
)
def test_what_is_not_defined_or_not_active_is_not_found(text: str) -> None:
    found = find_by_type(stage_of(text.format("").replace('over "s"', 'over Shader "s"')), Diagnostics())
    assert found.shaders == []


@pytest.mark.parametrize("above", ABOVE)
def test_cameras_and_settings_are_those_of_the_world(above: str) -> None:
    stage = stage_of(
        f'{above}\n{{\n def Camera "c"\n {{\n }}\n def RenderSettings "r"\n {{\n int2 resolution = (5, 7)\n }}\n}}\n{BOX}'
    )
    in_world = above.startswith("def")
    assert camera_paths(stage) == (["/L/c"] if in_world else [])
    assert [product.settings_path for product in products(stage)] == (["/L/r"] if in_world else [""])
    assert translate(stage, RenderSettings())[0].camera.path == ("/L/c" if in_world else "")


def test_prototypes_of_prototypes_are_led_to() -> None:
    inner = instancer("q", "/L/box")
    text = f'class "L"\n{{\n{BOX}{inner}}}\nclass "unused"\n{{\n{instancer("u", "/L/none")}{BOX}}}\n{instancer("p", "/L/q")}'
    stage = stage_of(text)
    roots = instanced_roots(stage)
    assert [str(root.GetPath()) for root in roots] == ["/L/q", "/L/box"]
    assert not any(map(is_in_world, roots))


def test_instancers_that_contain_themselves_end() -> None:
    text = f'class "L"\n{{\n{instancer("q", "/L/q")}}}\n{instancer("p", "/L/q")}'
    stage = stage_of(text)
    assert [str(root.GetPath()) for root in instanced_roots(stage)] == ["/L/q"]


@pytest.mark.parametrize("inner", ["class", "over"])
def test_what_is_abstract_in_a_prototype_is_not_drawn_with_it(inner: str) -> None:
    library = f'{inner} Xform "Inner"\n{{\n def Cube "leaf"\n {{\n }}\n}}\n'
    text = f'class "L"\n{{\n def Xform "tree"\n {{\n{BOX}{library}}}\n}}\n{instancer("p", "/L/tree")}'
    description, _ = translate_text(text)
    assert [shape.path for shape in description.shapes] == ["/L/tree/box"]


@pytest.mark.parametrize("above", ABOVE)
def test_the_automatic_camera_sees_prototypes_wherever_they_stand(above: str) -> None:
    hidden = 'token visibility = "invisible"\n' if above.startswith("def") else ""
    text = f"{above}\n{{\n{hidden}{BOX}}}\n" + instancer("p", "/L/box", "[(-9, 0, 0), (31, 0, 0)]") + BOX
    camera = translate_text(text, RenderSettings(auto_camera="usdrecord"))[0].camera
    assert camera.world_from_camera[:3, 3] == pytest.approx([11, 0, camera.world_from_camera[2, 3]])
    assert camera.world_from_camera[2, 3] > 50
    description, _ = translate_text(text)
    pixels = description.camera.project([(-9, 0, 0), (31, 0, 0)], description.resolution)
    assert 0 < pixels[:, 0].min() < 100 < 860 < pixels[:, 0].max() < 960


def test_standing_in_the_world_ends() -> None:
    stage = stage_of(f'class "L"\n{{\n over "o"\n {{\n{BOX} }}\n}}\n')
    before = stage.GetRootLayer().ExportToString()
    with temporarily_defined(stage, ["/L/o/box"]):
        assert is_in_world(stage.GetPrimAtPath("/L/o/box"))
        assert [str(p.GetPath()) for p in stage.Traverse()] == ["/L", "/L/o", "/L/o/box"]
    assert list(stage.Traverse()) == []
    assert stage.GetRootLayer().ExportToString() == before


def test_a_skeleton_that_is_a_class_itself_is_posed_and_stays_one() -> None:
    text = f'class SkelRoot "L"\n{{\n{character()}}}\n{instancer("p", "/L", "[(0, 0, 0), (5, 0, 0)]")}'
    description, diagnostics = translate_text(text)
    assert ("posed", "/L") in diagnostics
    assert len(description.shapes) == 1
    assert sum(len(np.concatenate(list(p.chunks()))) for p in description.placements) == 2


def test_skeletons_that_nothing_leads_to_cost_no_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> Usd.Stage:
        raise AssertionError("a copy was made")

    monkeypatch.setattr("primray.usd.skinning.baking.scratch_copy", fail)
    translate_text(f'class "L"\n{{\n def SkelRoot "r"\n {{\n }}\n}}\n{BOX}')
    with pytest.raises(AssertionError, match="a copy was made"):
        translate_text(f'class "L"\n{{\n def SkelRoot "r"\n {{\n }}\n}}\n{instancer("p", "/L/r")}')
