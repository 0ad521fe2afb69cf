"""Domes turned after the render: what a render of the turned stage gives, within errors that hold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.light_mix.test_light_mix import FILL, KEY, ROOM, SIZE

from primray import Image, LightMix, compare, read_image, relight, render, turn_dome
from primray.cli import run
from primray.errors import SettingsError
from primray.render.turned_dome import settings_of_header
from primray.settings import RenderSettings

LIT = "    float inputs:intensity = 1\n    asset inputs:texture:file = @sky.exr@\n"
AROUND = '    double xformOp:rotateY = {}\n    uniform token[] xformOpOrder = ["xformOp:rotateY"]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Stages of a room under a dome that is bright on one side: as authored, and turned by 90 degrees."""
    import OpenImageIO as oiio

    place = tmp_path_factory.mktemp("turned")
    sky = np.full((16, 32, 3), 0.1, np.float32)
    sky[4:8, 6:12] = (6, 4, 1)
    sky[:, 20:24] = (0, 0.2, 1)
    file = oiio.ImageOutput.create(str(place / "sky.exr"))
    assert file is not None
    file.open(str(place / "sky.exr"), oiio.ImageSpec(32, 16, 3, "float"))
    file.write_image(sky)
    file.close()
    from tests.images.aovs.seen import stage_of

    for name, degrees in (("room", 0), ("turned", 90)):
        held = stage_of(ROOM + KEY + FILL, light=f'def DomeLight "sky"\n{{\n{LIT}{AROUND.format(degrees)}}}\n')
        held.GetRootLayer().Export(str(place / f"{name}.usda"))
    return place


def settings(**more: Any) -> RenderSettings:
    return replace(RenderSettings(resolution=SIZE, spp=64, seed=3, threads=1, aovs=("lights",)), **more)


def picture(folder: Path, name: str = "room", **more: Any) -> Image:
    return render(folder / f"{name}.usda", settings(**more), progress=False)


def test_a_turned_dome_is_what_a_render_of_the_turned_stage_gives(folder: Path) -> None:
    before = picture(folder, spp=256)
    turned = turn_dome(before, folder / "room.usda", {"/sky": 90})
    new = picture(folder, "turned", spp=256, seed=8)
    assert compare(turned.mixed({}), new, tolerance=0.1).verdict.value == "unchanged"
    assert compare(before, new, tolerance=0.1).verdict.value == "changed"
    weights: dict[str, Any] = {"sky": (0.5, 1.0, 2.0), "key": 0.25}
    assert compare(turned.mixed(weights), relight(new, weights), tolerance=0.1).verdict.value == "unchanged"


def test_only_the_domes_part_changes(folder: Path) -> None:
    before = LightMix.of(picture(folder))
    turned = turn_dome(before, folder / "room.usda", {"sky": 90})
    for old, new in zip(before.parts, turned.parts, strict=True):
        assert np.array_equal(old.light, new.light) == (old.name != "sky")
    # What is rendered alone, by the same seed, has the light of the part in a picture that is not turned.
    same = turn_dome(before, folder / "room.usda", {"sky": 0}, spp=64)
    assert np.allclose(same.mixed({}).pixels, before.image.pixels, atol=0.3)


def test_errors_after_a_turn_hold(folder: Path) -> None:
    made = [
        turn_dome(picture(folder, spp=8, seed=seed), folder / "room.usda", {"sky": 90}).mixed({"key": 2.0})
        for seed in range(32)
    ]
    pixels = np.stack([image.pixels[..., :3] for image in made]).astype(np.float64)
    told = np.mean([np.asarray(image.errors, np.float64) ** 2 for image in made], axis=0)
    seen = pixels.var(axis=0, ddof=1)
    lit = seen > 1e-12
    assert told[lit].sum() / seen[lit].sum() == pytest.approx(1, abs=0.15)


def test_the_command_turns_and_saves_parts(folder: Path, capsys: Any, monkeypatch: Any) -> None:
    monkeypatch.chdir(folder)
    picture(folder).save("room.exr")
    assert run(["relight", "room.exr", "--turn", "/sky=90", "--stage", "room.usda", "-l", "key=0.5", "-o", "m.exr"]) == 0
    assert "turned by 90 degrees" in capsys.readouterr().out
    saved = read_image("m.exr")
    assert saved.metadata["relight.turn.sky"] == 90
    expected = turn_dome("room.exr", "room.usda", {"/sky": 90}).mixed({"key": 0.5})
    assert np.array_equal(saved.pixels, expected.pixels)
    assert (
        run(["relight", "room.exr", "--turn", "sky=45", "--stage", "room.usda", "--turn-spp", "4", "--report", "m.json"]) == 0
    )
    assert json.loads(Path("m.json").read_text())["turns"] == {"sky": 45}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--turn", "/sky=90"], "--stage"),
        (["--turn", "/sky", "--stage", "room.usda"], "NAME=DEGREES"),
        (["--turn", "/moon=9", "--stage", "room.usda"], "no light"),
        (["--turn", "key=9", "--stage", "room.usda"], "no dome"),
    ],
)
def test_what_cannot_be_turned_is_an_error(
    folder: Path, capsys: Any, monkeypatch: Any, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(folder)
    picture(folder, spp=2).save("few.exr")
    assert run(["relight", "few.exr", *arguments]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("values", [{"region": (0.25, 0.25, 0.75, 0.75), "spp": 16}, {"sample_range": (32, 48), "spp": None}])
def test_a_part_of_a_picture_has_the_samples_that_it_has(folder: Path, values: dict[str, Any]) -> None:
    before = LightMix.of(picture(folder, **values))
    same = turn_dome(before, folder / "room.usda", {"sky": 0})
    asked = [settings_of_header(mix.image.metadata, mix.image.resolution, None) for mix in (before, same)]
    assert {(one.spp, one.sample_range, one.region) for one in asked} == {
        (values["spp"], values.get("sample_range"), values.get("region"))
    }
    assert settings_of_header(before.image.metadata, before.image.resolution, 4).spp == 4


def test_pictures_without_the_settings_of_a_render_are_refused(folder: Path) -> None:
    image = picture(folder, spp=2)
    bare = replace(image, metadata={k: v for k, v in image.metadata.items() if not k.startswith("settings.")})
    with pytest.raises(SettingsError) as caught:
        turn_dome(bare, folder / "room.usda", {"sky": 90})
    assert caught.value.code == "lights-turn"
