"""Pictures in which nothing is seen are told, with the likely reason; others are not."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import primray
from primray.errors import UnsupportedError

CAMERA = 'def Camera "cam" { double3 xformOp:translate = (0, 0, 10)\n uniform token[] xformOpOrder = ["xformOp:translate"]\n'
NEAR = "float2 clippingRange = (20, 1000) }\n"
FAR = "float2 clippingRange = (1, 5) }\n"
BALL = 'def Sphere "ball" {}\n'
LAMP = 'def DistantLight "lamp" { float inputs:intensity = %d }\n'
PATCH = 'def GenerativeProcedural "ball" {}\n'
MOVED = 'def Sphere "ball" { double3 xformOp:translate = %s\n uniform token[] xformOpOrder = ["xformOp:translate"] }\n'

EMPTY = {
    "behind": (CAMERA + "}\n" + MOVED % "(0, 0, 30)", "lies behind it"),
    "beside": (CAMERA + "}\n" + MOVED % "(100, 0, 0)", "lies beside its view"),
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
    "dark": (CAMERA + "}\n" + BALL + LAMP % 0, "What the camera sees is black"),
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


@pytest.mark.parametrize("lamp", ["", LAMP % 1])
def test_a_picture_with_something_in_it_is_not(lamp: str, tmp_path: Path) -> None:
    assert said(primray.render(written(tmp_path, CAMERA + "}\n" + BALL + lamp), settings())) == []


def test_strict_refuses_it(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match="empty-picture"):
        primray.render(written(tmp_path, EMPTY["behind"][0]), settings(strict=True))
