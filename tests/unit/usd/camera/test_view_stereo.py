"""Which two cameras are a stereo pair, from whichever of its prims one asks, and that there is none otherwise."""

from __future__ import annotations

import pytest

from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of


def camera(name: str, role: str = "mono", inside: str = "") -> str:
    return f'def Camera "{name}"\n{{\nuniform token stereoRole = "{role}"\n{inside}}}\n'


def rig(name: str, inside: str) -> str:
    return f'def Xform "{name}"\n{{\n{inside}}}\n'


LEFT, RIGHT, CENTER = camera("left", "left"), camera("right", "right"), camera("center")
PAIR = LEFT + RIGHT
STAGES = {
    "alone": (PAIR, None, ("/left", "/right")),
    "by the left": (rig("a", PAIR) + rig("b", PAIR), "/b/left", ("/b/left", "/b/right")),
    "by the right": (rig("a", PAIR) + rig("b", PAIR), "/b/right", ("/b/left", "/b/right")),
    "by one between them": (rig("a", PAIR) + rig("b", CENTER + PAIR), "/b/center", ("/b/left", "/b/right")),
    "by one above them": (rig("a", PAIR) + camera("rig", inside=PAIR), "/rig", ("/rig/left", "/rig/right")),
    "apart": (rig("a", LEFT) + rig("b", RIGHT) + CENTER, "/a/left", ("/a/left", "/b/right")),
    "two lefts": (rig("a", PAIR + camera("other", "left")), "/a/other", ("/a/other", "/a/right")),
}


def seen(text: str, asked: str | None, eye: str) -> tuple[str, list[str]]:
    description, diagnostics = translate(stage_of(text), RenderSettings(camera=asked, eye=eye))  # type: ignore[arg-type]
    return description.camera.path, [d.attribute for d in diagnostics]


@pytest.mark.conforms("Camera.stereoRole")
@pytest.mark.parametrize("name", STAGES)
def test_pairs(name: str) -> None:
    text, asked, eyes = STAGES[name]
    for eye, path in zip(("left", "right"), eyes, strict=True):
        found, told = seen(text, asked, eye)
        assert found == path
        assert "stereoRole" not in told


@pytest.mark.parametrize(
    ("text", "asked", "code"),
    [
        (CENTER, None, "stereo-pair"),
        (LEFT, "/left", "stereo-pair"),
        (CENTER + RIGHT, "/center", "stereo-pair"),
        ("", None, "stereo-pair"),
        (rig("a", PAIR) + rig("b", PAIR), None, "stereo-ambiguous"),
        (PAIR + camera("other", "left"), "/right", "stereo-ambiguous"),
        (PAIR, "/middle", "unknown-camera"),
    ],
)
def test_where_there_is_none(text: str, asked: str | None, code: str) -> None:
    with pytest.raises(SettingsError) as refusal:
        seen(text, asked, "left")
    assert refusal.value.code == code


def test_a_matrix_has_no_eyes() -> None:
    standing = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]
    with pytest.raises(SettingsError) as refusal:
        translate(stage_of(PAIR), RenderSettings(camera=standing, eye="left"))
    assert refusal.value.code == "stereo-pair"


def test_the_camera_of_render_settings_counts() -> None:
    text = rig("a", PAIR) + rig("b", PAIR) + 'def RenderSettings "s"\n{\nrel camera = </b/right>\n}\n'
    assert translate(stage_of(text), RenderSettings(render_settings="/s", eye="left"))[0].camera.path == "/b/left"
