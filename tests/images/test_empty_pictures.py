"""Pictures in which nothing is seen are told, with the likely reason; others are not."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pxr import Usd

import primray
from primray.errors import UnsupportedError
from primray.usd import undrawn_shapes

CAMERA = 'def Camera "cam" { double3 xformOp:translate = (0, 0, 10)\n uniform token[] xformOpOrder = ["xformOp:translate"]\n'
NEAR = "float2 clippingRange = (20, 1000) }\n"
FAR = "float2 clippingRange = (1, 5) }\n"
BALL = 'def Sphere "ball" {}\n'
LAMP = 'def DistantLight "lamp" { float inputs:intensity = %d }\n'
PATCH = 'def GenerativeProcedural "ball" {}\n'
MOVED = 'def Sphere "ball" { double3 xformOp:translate = %s\n uniform token[] xformOpOrder = ["xformOp:translate"] }\n'

EMPTY = {
    "behind": (CAMERA + "}\n" + MOVED % "(0, 0, 30)", "is behind it"),
    "beside": (CAMERA + "}\n" + MOVED % "(100, 0, 0)", "is outside its view"),
    "near": (CAMERA + NEAR + BALL, "nearer than its near clipping plane, 20"),
    "far": (CAMERA + FAR + BALL, "beyond its far clipping plane, 5"),
    "nothing": (CAMERA + "}\n", "the stage holds no geometry"),
    "unsupported": (CAMERA + "}\n" + PATCH, r"/ball is missing \(unsupported-prim\)"),
    "invisible": (CAMERA + "}\n" + 'def Sphere "ball" { token visibility = "invisible" }', "1 shape is invisible"),
    "guide": (
        CAMERA + "}\n" + 'def Sphere "ball" { uniform token purpose = "guide" }',
        "of purpose guide, which is not rendered",
    ),
    "class": (CAMERA + "}\n" + 'class Sphere "ball" {}', "below an abstract prim"),
    "dark": (CAMERA + "}\n" + BALL + LAMP % 0, "Everything the camera sees is black"),
}


def written(folder: Path, text: str) -> Path:
    path = folder / "stage.usda"
    path.write_text('#usda 1.0\n(upAxis = "Y")\n' + text.replace("}", "\n}"))
    return path


def settings(**more: Any) -> primray.RenderSettings:
    return primray.RenderSettings(spp=2, resolution=(16, 16), camera="/cam", **more)


def said(image: primray.Image) -> list[str]:
    return [d["message"] for d in image.report["diagnostics"] if d["code"] == "empty-picture"]


@pytest.mark.parametrize("name", EMPTY)
def test_an_empty_picture_is_told_with_its_reason(name: str, tmp_path: Path) -> None:
    text, reason = EMPTY[name]
    image = primray.render(written(tmp_path, text), settings())
    (message,) = said(image)
    assert re.search(reason, message), message


SKY = 'def DomeLight "sky" {}\n'
CARD = """def RectLight "card" { float inputs:width = 40
 float inputs:height = 40
 double3 xformOp:translate = (0, 0, -5)
 double xformOp:rotateY = 180
 uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"] }
"""
PASS = """def RenderPass "p" { uniform bool collection:%s:includeRoot = %s
 rel collection:%s:%s = [</ball>, </crowd>] }
"""
CROWD = """def PointInstancer "crowd" { uniform token purpose = "render"
 rel prototypes = </crowd/one>
 int[] protoIndices = [0, 0]
 point3f[] positions = [(0, 0, 0), (2, 0, 0)]
 def Sphere "one" {} }
"""
BARE: dict[str, tuple[str, dict[str, Any], str]] = {
    "purposes": ('def Sphere "ball" { uniform token purpose = "render" }\n', {"purposes": ("default",)}, "of purpose render"),
    "a crowd": (CROWD, {"purposes": ("default",)}, "of purpose render"),
    "invisible": ('def Sphere "ball" { token visibility = "invisible" }\n', {}, "invisible at this frame"),
    "class": ('class Sphere "ball" {}\n', {}, "below an abstract prim"),
    "payload": ('def "far" (payload = @far.usda@</ball>) {}\n', {"load": ()}, r"/far is missing \(payloads-unloaded\)"),
    "mask": (BALL, {"mask": ("/cam", "/sky", "/card")}, "outside the mask"),
    "pruned": (BALL + PASS % ("prune", "false", "prune", "includes"), {"render_pass": "/p"}, "left out by the render pass /p"),
    "hidden": (
        BALL + PASS % ("renderVisibility", "true", "renderVisibility", "excludes"), {"render_pass": "/p"}, "the render pass /p"
    ),
    "unseen": (
        BALL + PASS % ("cameraVisibility", "true", "cameraVisibility", "excludes"), {"render_pass": "/p"}, "is hidden from it"
    ),
}  # fmt: skip


@pytest.mark.parametrize("light", [SKY, CARD, SKY + CARD], ids=["sky", "card", "both"])
@pytest.mark.parametrize("name", BARE)
def test_lights_alone_are_told_where_there_is_geometry(name: str, light: str, tmp_path: Path) -> None:
    text, more, reason = BARE[name]
    (tmp_path / "far.usda").write_text('#usda 1.0\ndef Sphere "ball"\n{\n}\n')
    lights = light if "mask" not in more or "card" in light else light + 'def Scope "card" {}\n'
    lights = lights if "mask" not in more or "sky" in light else lights + 'def Scope "sky" {}\n'
    image = primray.render(written(tmp_path, CAMERA + "}\n" + text + lights), settings(**more))
    assert image.pixels[..., :3].any()
    (message,) = said(image)
    assert re.search(reason, message), message


@pytest.mark.parametrize(
    "text",
    [SKY, SKY + CARD, BALL + CARD.replace("-5", "5"), SKY + MOVED % "(0, 0, 30)"],
    ids=["sky", "lights alone", "a light that hides all", "a view of the sky"],
)
def test_lights_that_are_meant_to_be_seen_are_not(text: str, tmp_path: Path) -> None:
    image = primray.render(written(tmp_path, CAMERA + "}\n" + text), settings())
    assert image.pixels[..., :3].any()
    assert said(image) == []


def test_purposes_of_the_stages_own_settings(tmp_path: Path) -> None:
    path = written(tmp_path, CAMERA + "}\n" + SKY + CROWD)
    head = '#usda 1.0\n(\nupAxis = "Y"\nrenderSettingsPrimPath = "/Render/s"\n)\n'
    render = 'def Scope "Render"\n{\ndef RenderSettings "s"\n{\nuniform token[] includedPurposes = ["default"]\n}\n}\n'
    path.write_text(head + path.read_text().partition(")\n")[2] + render)
    (message,) = said(primray.render(path, settings()))
    assert "of purpose render" in message


ELSEWHERE = """class "kinds" { token visibility = "invisible"
 def Xform "kind" {
 def Sphere "one" { %s }
 }
 def PointInstancer "few" { int[] protoIndices = [0]
 point3f[] positions = [(0, 0, 0)]
 rel prototypes = </kinds/kind> }
 }
def PointInstancer "crowd" { %s
 int[] protoIndices = [0]
 point3f[] positions = [(0, 0, 0)]
 rel prototypes = </kinds/few> }
"""
RENDER, HIDDEN = 'uniform token purpose = "render"', 'token visibility = "invisible"'


@pytest.mark.parametrize(
    ("shape", "crowd", "reason"),
    [
        (RENDER, "", "1 shape is of purpose render"),
        ("", RENDER, "1 shape is of purpose render"),
        (HIDDEN, "", "1 shape is invisible"),
        ("", HIDDEN, "1 shape is invisible"),
    ],
)
def test_prototypes_below_a_class_are_not_drawn_for_the_reason_that_counts(
    shape: str, crowd: str, reason: str, tmp_path: Path
) -> None:
    path = written(tmp_path, CAMERA + "}\n" + SKY + ELSEWHERE % (shape, crowd))
    (message,) = said(primray.render(path, settings(purposes=("default",))))
    assert reason in message


def test_what_one_crowd_draws_is_not_left_out_by_another(tmp_path: Path) -> None:
    crowd = ELSEWHERE.rpartition("def")[2]
    both = ELSEWHERE % ("", HIDDEN) + "def" + (crowd % "").replace('"crowd"', '"seen"')
    path = written(tmp_path, CAMERA + "}\n" + both)
    assert undrawn_shapes(Usd.Stage.Open(str(path)), settings()) == {}


@pytest.mark.parametrize("lamp", ["", LAMP % 1])
def test_a_picture_with_something_in_it_is_not(lamp: str, tmp_path: Path) -> None:
    assert said(primray.render(written(tmp_path, CAMERA + "}\n" + BALL + lamp), settings())) == []


def test_strict_refuses_it(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match="empty-picture"):
        primray.render(written(tmp_path, EMPTY["behind"][0]), settings(strict=True))
