"""`primray doctor SCENE` on stages that are slow, grey, dark or empty, each for a reason that it has to name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import OpenImageIO as oiio
import pytest
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

from primray.cli import run

HEAD = """#usda 1.0
(
    metersPerUnit = {unit}
    upAxis = "Y"
)
def Camera "cam"
{{
    double3 xformOp:translate = (0, 0, {away})
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
CUBE = """def Cube "{name}"
{{
    double size = {size}
    double3 xformOp:translate = ({x}, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    {more}
}}
"""
DOME = 'def DomeLight "dome" { }\n'
COLOR = "color3f[] primvars:displayColor = [(0.8, 0.1, 0.1)]"
LONGER = ("--pilot", "1")  # for what is measured: on a machine that is busy with others a tenth of a second has no samples
BIND = """prepend apiSchemas = ["MaterialBindingAPI"]"""


def cube(name: str, size: float = 1, x: float = 0, more: str = COLOR) -> str:
    return CUBE.format(name=name, size=size, x=x, more=more)


def head(away: float = 12, unit: float = 1) -> str:
    return HEAD.format(away=away, unit=unit)


def material(shader: str) -> str:
    return f"""def Material "mat"
{{
    token outputs:surface.connect = </mat/s.outputs:surface>
    {shader}
}}
def Cube "box" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </mat>
    float2[] primvars:st = [(0, 0)] (interpolation = "constant")
}}
"""


def doctor(tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str], *flags: str) -> dict[str, Any]:
    stage = tmp_path / "stage.usda"
    stage.write_text(text)
    line = ["doctor", str(stage), "--json", "--res", "48", "32", "--pilot", "0.1", "-c", "/cam", *flags]
    assert run(line) == 0
    facts: dict[str, Any] = json.loads(capsys.readouterr().out)
    return facts


def found(facts: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {finding["code"]: finding for finding in facts["findings"]}


def test_a_stage_without_fault_has_nothing_to_find(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    facts = doctor(tmp_path, head() + DOME + cube("box", 2), capsys)
    assert facts["findings"] == []
    assert 0.1 < facts["picture"]["hit_share"] < 0.9
    assert facts["picture"]["grey_share"] == 0
    assert facts["speed"]["rays_per_s"] > 0
    assert run(["doctor", str(tmp_path / "stage.usda"), "--res", "48", "32", "--pilot", "0.1"]) == 0
    assert "Nothing was found" in capsys.readouterr().out


def test_a_camera_that_looks_away(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    facts = doctor(tmp_path, head(-5) + DOME + cube("box"), capsys)
    told = found(facts)["camera-sees-nothing"]
    assert "behind" in told["message"]
    assert told["prims"] == ["/cam"]
    assert facts["picture"]["hit_share"] == 0


def test_geometry_far_smaller_than_the_view(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = found(doctor(tmp_path, head(500) + DOME + cube("box"), capsys))["small-in-view"]
    assert "1.732 units across" in told["message"]


def test_what_purpose_and_visibility_hide(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hidden = cube("proxy", x=1, more='uniform token purpose = "proxy"') + cube("gone", more='token visibility = "invisible"')
    facts = doctor(tmp_path, head() + DOME + cube("box") + hidden, capsys)
    told = [finding for finding in facts["findings"] if finding["code"] == "hidden"]
    assert [finding["prims"] for finding in told] == [["/proxy"], ["/gone"]]
    assert "purpose proxy" in told[0]["message"]
    assert "invisible" in told[1]["message"]
    assert "hidden" in found(doctor(tmp_path, head() + DOME + hidden, capsys))  # with nothing left to see
    assert "nothing-drawn" in found(doctor(tmp_path, head() + DOME + hidden, capsys))
    shown = doctor(tmp_path, head() + DOME + cube("box") + hidden, capsys, "--purposes", "default,proxy")
    assert [finding["prims"] for finding in shown["findings"] if finding["code"] == "hidden"] == [["/gone"]]


def test_a_reference_that_leads_nowhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = head() + DOME + cube("box") + 'def Xform "car" (references = @./gone.usda@) { }\n'
    told = found(doctor(tmp_path, text, capsys))["composition-error"]
    assert told["question"] == "empty"


@pytest.mark.parametrize(("unit", "size", "is_told"), [(0.01, 2, False), (1000, 200, True), (1e-6, 2, True)])
def test_a_stage_of_an_odd_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], unit: float, size: float, is_told: bool
) -> None:
    told = found(doctor(tmp_path, head(6 * size, unit) + DOME + cube("box", size), capsys))
    assert ("size" in told) == is_told


def test_a_stage_without_lights(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "default-light" in found(doctor(tmp_path, head() + cube("box", 2), capsys))
    assert "no-light" in found(doctor(tmp_path, head() + cube("box", 2), capsys, "--no-default-light"))


def test_an_exposure_that_shows_black(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dim = 'def DomeLight "dome"\n{\n    float inputs:intensity = 0.0001\n}\n'
    assert "black" in found(doctor(tmp_path, head() + dim + cube("box", 2), capsys))["view-exposure"]["message"]


def test_shapes_without_material(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    facts = doctor(tmp_path, head() + DOME + cube("red", 2, -1.2) + cube("grey", 2, 1.2, more=""), capsys)
    told = found(facts)["no-material"]
    assert told["prims"] == ["/grey"]
    assert told["share"] == pytest.approx(0.5, abs=0.1)
    assert facts["picture"]["grey_share"] == pytest.approx(told["share"], abs=0.05)


@pytest.mark.parametrize(
    ("shader", "code"),
    [
        (
            """def Shader "s"
            {
                uniform token info:id = "OtherSurface"
                token outputs:surface
            }""",
            "shader-ignored",
        ),
        (
            """def Shader "s"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </mat/t.outputs:rgb>
                token outputs:surface
            }
            def Shader "t"
            {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./gone.png@
                float3 outputs:rgb
            }""",
            "asset-missing",
        ),
    ],
)
def test_materials_that_are_not_what_they_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], shader: str, code: str
) -> None:
    text = head() + DOME + material(shader)
    told = found(doctor(tmp_path, text, capsys))[code]
    assert told["question"] == {"shader-ignored": "grey", "asset-missing": "dark"}[code]  # a missing texture is black
    assert told["prims"] == ["/mat"]
    assert told["share"] == 1


def test_materials_that_are_grey_by_themselves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grey = "color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]"
    assert set(found(doctor(tmp_path, head() + DOME + cube("box", 2, more=grey), capsys))) == {"grey-as-authored"}


def test_a_texture_that_no_picture_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    size = 4800
    image = oiio.ImageBuf(oiio.ImageSpec(size, size, 3, "uint8"))
    oiio.ImageBufAlgo.fill(image, (0.8, 0.1, 0.1))
    image.specmod()["compression"] = "none"
    assert image.write(str(tmp_path / "large.tif"))
    shader = """def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </mat/t.outputs:rgb>
        token outputs:surface
    }
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./large.tif@
        float2 inputs:st = (0.5, 0.5)
        float3 outputs:rgb
    }"""
    told = found(doctor(tmp_path, head() + DOME + material(shader), capsys))["large-textures"]
    assert f"large.tif ({size} x {size}, 66 MiB)" in told["message"]


def test_the_light_that_brings_the_noise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A strong sphere that half hides behind a bar, beside a faint dome."""
    lights = """def SphereLight "lamp"
{
    float inputs:radius = 1
    float inputs:intensity = 40
    double3 xformOp:translate = (0, 4, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "dome"
{
    float inputs:intensity = 0.01
}
"""
    facts = doctor(tmp_path, head(16) + lights + cube("left", 2, -1.3) + cube("right", 2, 1.1), capsys, "--pilot", "0.001")
    assert found(facts)["noisy-light"]["prims"] == ["/lamp"]
    assert found(facts)["noisy-light"]["share"] > 0.8


def test_the_prim_that_has_the_noise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A ball of glass, whose paths part, before cubes that the sun lights without noise."""
    text = """def DistantLight "sun"
{
    float inputs:angle = 0
}
def Material "glass"
{
    token outputs:surface.connect = </glass/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:roughness = 0
        float inputs:opacity = 0
        token outputs:surface
    }
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    double radius = 0.8
    rel material:binding = </glass>
    double3 xformOp:translate = (0, 0, 2)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    facts = doctor(tmp_path, head(16) + text + cube("left", 2, -1.3) + cube("right", 2, 1.1), capsys, *LONGER)
    told = found(facts)["hot-spot"]
    assert told["prims"] == ["/ball", "/glass"]


def test_the_volume_that_has_the_noise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """White smoke with a bright lamp in it, and a cube that the sky lights."""
    write(tmp_path, grid(0.5))
    look = """def Material "Look"
{
    token outputs:arnold:volume.connect = </Look/Shader.outputs:out>
    def Shader "Shader"
    {
        uniform token info:id = "arnold:standard_volume"
        color3f inputs:scatter_color = (1, 1, 1)
        token outputs:out
    }
}
def SphereLight "lamp"
{
    float inputs:radius = 0.1
    float inputs:intensity = 3000
}
"""
    placed = """
    double3 xformOp:translate = (-3.5, -3.5, -3.5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
"""
    text = head(16) + DOME + look + volume_text(None, placed, bound="/Look") + cube("left", 2, -5)
    facts = doctor(tmp_path, text, capsys, *LONGER)
    told = found(facts)["noisy-volume"]
    assert told["prims"] == ["/Smoke"]
    assert told["share"] > 0.5
    assert "max-depth" in told["advice"]
    assert "hot-spot" not in found(facts)


def test_a_picture_of_smoke_alone_is_not_empty(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, grid(0.5))
    facts = doctor(tmp_path, head(24) + DOME + volume_text(), capsys)
    assert facts["picture"]["hit_share"] == 0
    assert not {"small-in-view", "camera-sees-nothing", "nothing-drawn", "unlit"} & set(found(facts))


def test_a_fire_is_a_light(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, grid(0.5), grid(2, name="emission"))
    facts = doctor(tmp_path, head(24) + cube("box") + volume_text({"density": "", "emission": ""}), capsys)
    assert not {"no-light", "default-light"} & set(found(facts))


def test_emission_in_a_shape_is_a_light(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    glow = material(
        'def Shader "s" { uniform token info:id = "kma_volume"\ncolor3f inputs:emission = (1, 1, 1)\ntoken outputs:surface\n}'
    )
    facts = doctor(tmp_path, head() + glow.replace("outputs:surface.connect", "outputs:kma:volume.connect"), capsys)
    assert not {"no-light", "default-light"} & set(found(facts))


def test_a_shader_of_smoke_makes_nothing_grey(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, grid(0.5))
    look = """def Material "Look"
{
    token outputs:arnold:volume.connect = </Look/Shader.outputs:out>
    def Shader "Shader"
    {
        uniform token info:id = "arnold:standard_volume"
        token outputs:out
    }
}
"""
    facts = doctor(tmp_path, head(24) + DOME + look + volume_text(bound="/Look") + cube("box"), capsys)
    assert "translated" not in found(facts)


def test_what_setting_up_takes_its_time_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A cage diced as finely as a small machine bears: dicing and building are what is waited for."""
    cage = """def Mesh "blob"
{
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4]
    point3f[] points = [(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1), (-1, 1, -1), (1, 1, -1), (-1, -1, -1), (1, -1, -1)]
    color3f[] primvars:displayColor = [(0.8, 0.1, 0.1)]
}
"""
    facts = doctor(tmp_path, head() + DOME + cage, capsys, "--dicing-rate", "0.02")
    told = found(facts)
    assert told["many-triangles"]["prims"] == ["/blob"]
    assert facts["counts"]["triangles_unique"] > 200_000
    if "set-up" in told:  # a quick machine takes less than what is worth a word
        assert told["set-up"]["message"].split(",")[1].split()[0] in ("dice", "build")


def test_machine_checks_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "--json"]) == 0
    checks = json.loads(capsys.readouterr().out)["checks"]
    assert {row["check"] for row in checks} == {"primray", "cpu", "core", "usd", "images", "colour", "volumes", "schemas"}
    assert all(row["works"] for row in checks)


def test_bad_stages_end_as_in_the_other_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", str(tmp_path / "none.usda")]) == 3
    (tmp_path / "stage.usda").write_text(head() + DOME + cube("box") + 'def Xform "car" (references = @./gone.usda@) { }\n')
    assert run(["doctor", str(tmp_path / "stage.usda"), "--strict"]) == 3
    assert run(["doctor", str(tmp_path / "stage.usda"), "--pilot", "0"]) == 2
