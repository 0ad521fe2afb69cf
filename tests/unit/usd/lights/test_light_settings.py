"""ShadowAPI and the attributes by which a light hides from the camera, as the description has them."""

from __future__ import annotations

import pytest

from primray.description import Light, Shadow
from primray.usd.scene.schemas import CAMERA_VISIBILITY

from ..usd_text import translate_text


def light(body: str, kind: str = "SphereLight") -> tuple[Light, list[str]]:
    d, found = translate_text(f'def {kind} "light" (\n prepend apiSchemas = ["ShadowAPI"]\n)\n{{\n{body}\n}}\n')
    (only,) = d.lights
    return only, [code for code, path in found if path == "/light"]


@pytest.mark.conforms("ShadowAPI.inputs:shadow:enable", "ShadowAPI.inputs:shadow:color", "ShadowAPI.inputs:shadow:distance")
@pytest.mark.conforms("ShadowAPI.inputs:shadow:falloff", "ShadowAPI.inputs:shadow:falloffGamma")
@pytest.mark.parametrize("kind", ["SphereLight", "DomeLight", "DistantLight", "RectLight"])
@pytest.mark.parametrize(
    ("body", "expected", "codes"),
    [
        ("", None, []),
        ("bool inputs:shadow:enable = 1", None, []),
        ("bool inputs:shadow:enable = 0", Shadow(enabled=False), []),
        ("bool inputs:shadow:enable = 0\ncolor3f inputs:shadow:color = (1, 0, 0)", Shadow(enabled=False), []),
        ("color3f inputs:shadow:color = (1, 0.5, 0.25)", Shadow(color=(1.0, 0.5, 0.25)), []),
        ("color3f inputs:shadow:color = (0, 0, 0)", None, []),
        ("color3f inputs:shadow:color = (-1, 0, 0)", None, ["light-input"]),
        ("float inputs:shadow:distance = 2", Shadow(distance=2.0), []),
        ("float inputs:shadow:distance = 0", Shadow(distance=0.0), []),
        ("float inputs:shadow:distance = -3", None, []),
        ("float inputs:shadow:falloff = 1", None, ["light-input"]),
        (
            "float inputs:shadow:distance = 2\nfloat inputs:shadow:falloff = 0.5\nfloat inputs:shadow:falloffGamma = 3",
            Shadow(distance=2.0, falloff=0.5, falloff_gamma=3.0),
            [],
        ),
        ("float inputs:shadow:distance = 2\nfloat inputs:shadow:falloff = 0", Shadow(distance=2.0), []),
        (
            "float inputs:shadow:distance = 2\nfloat inputs:shadow:falloff = 9\nfloat inputs:shadow:falloffGamma = -3",
            Shadow(distance=2.0, falloff=9.0, falloff_gamma=0.0),
            ["light-input"],
        ),
        ("float inputs:shadow:distance = inf", None, ["wrong-type"]),
    ],
)
def test_shadow(kind: str, body: str, expected: Shadow | None, codes: list[str]) -> None:
    found, told = light(body, kind)
    assert found.shadow == expected
    assert told == codes


TYPES = dict(zip(CAMERA_VISIBILITY, ("bool", "int", "bool", "float", "bool"), strict=True))


@pytest.mark.parametrize("name", CAMERA_VISIBILITY)
def test_visibility_to_camera(name: str) -> None:
    for value in (0, 1):
        found, told = light(f"custom {TYPES[name]} {name} = {value}")
        assert found.visible_to_camera == bool(value)
        assert told == []
    assert light("")[0].visible_to_camera


def test_the_first_attribute_decides() -> None:
    first, second = CAMERA_VISIBILITY[0], CAMERA_VISIBILITY[3]
    found, told = light(f"custom bool {first} = 0\nfloat {second} = 1")
    assert not found.visible_to_camera
    assert told == ["light-input"]
    found, told = light(f"custom bool {first} = 1\nfloat {second} = 0.5")
    assert found.visible_to_camera
    assert told == ["light-input"]
    found, told = light(f'custom string {first} = "no"\nfloat {second} = 0')
    assert not found.visible_to_camera
    assert told == ["wrong-type"]


def test_an_invisible_light_is_none() -> None:
    d, _ = translate_text('def SphereLight "light"\n{\n token visibility = "invisible"\n}\n')
    assert all(x.path != "/light" for x in d.lights)


def test_purpose_of_lights() -> None:
    d, _ = translate_text('def SphereLight "light"\n{\n uniform token purpose = "guide"\n}\n')
    assert all(x.path != "/light" for x in d.lights)
