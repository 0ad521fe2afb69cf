"""Lights weighed after the render: the bits of the picture at weights of 1, what a new render would give, errors that hold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd
from tests.images.aovs.seen import stage_of
from tests.images.aovs.test_light_paths import GLOW, GREY, PLASTIC, lamp, plane

from primray import Image, LightMix, Scene, compare, read_image, relight, render, usd
from primray.checkpoints.checkpointing import Checkpointing
from primray.checkpoints.merge import merge
from primray.cli import run
from primray.errors import SettingsError
from primray.light_mix.fit import fit
from primray.settings import RenderSettings

SIZE = (24, 18)
KEY, FILL = (lamp(name, place=place) for name, place in (("key", "(-3, 2, 3)"), ("fill", "(3, -1, 4)")))
SKY = 'def DomeLight "sky"\n{\n    float inputs:intensity = 0.25\n}\n'
ROOM = (
    GREY + PLASTIC + GLOW + plane("floor", 0, 20, "grey") + plane("screen", 1.2, 0.3, "glow")
    + 'def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])\n{\n    rel material:binding = </plastic>\n}\n'
)  # fmt: skip


def settings(**more: Any) -> RenderSettings:
    return replace(RenderSettings(resolution=SIZE, spp=16, seed=3, threads=1, aovs=("lights",)), **more)


def picture(text: str = ROOM + KEY + FILL, light: str = SKY, **more: Any) -> Image:
    return render(stage_of(text, light=light), settings(**more), progress=False)


def errors_of(image: Image) -> Any:
    assert image.errors is not None
    return image.errors.astype(np.float64)


def lit(key: float, fill: float, sky: tuple[float, float, float]) -> str:
    """Return the room with lamps of these factors."""
    lamps = [
        text.replace("inputs:intensity = 20", f"inputs:intensity = {20 * factor}")
        for text, factor in ((KEY, key), (FILL, fill))
    ]
    return (
        ROOM
        + "".join(lamps)
        + SKY.replace("inputs:intensity = 0.25", f"inputs:intensity = 0.25\n    color3f inputs:color = {sky}")
    )


def test_lights_have_parts_by_name_that_add_up_to_the_picture_to_the_bit() -> None:
    image = picture()
    mix = LightMix.of(image)
    assert mix.names == ("key", "fill", "sky", "rest")
    assert [part.paths for part in mix.parts] == [("/key",), ("/fill",), ("/sky",), ()]
    assert all(part.light.max() > 0.01 for part in mix.parts)
    same = mix.mixed({})
    assert np.array_equal(same.pixels, image.pixels)
    assert np.allclose(errors_of(same), errors_of(image), rtol=1e-4, atol=1e-6)
    assert not mix.keeps_light
    assert np.array_equal(picture(aovs=()).pixels, image.pixels)


def test_a_mix_is_what_a_new_render_would_be_within_errors() -> None:
    weights: dict[str, Any] = {"key": 0.25, "fill": 3.0, "sky": (2.0, 1.0, 0.5)}
    mixed = relight(picture(spp=256), weights)
    again = render(stage_of(lit(0.25, 3, (2, 1, 0.5)), light=""), settings(spp=256, seed=9), progress=False)
    assert np.array_equal(mixed.pixels[..., 3], again.pixels[..., 3]) or np.allclose(
        mixed.pixels[..., 3], again.pixels[..., 3], atol=0.1
    )
    found = compare(mixed, again, tolerance=0.1)
    assert found.verdict.value == "unchanged"
    assert compare(picture(spp=256), again, tolerance=0.1).verdict.value == "changed"


def test_errors_of_mixes_hold() -> None:
    """Of 40 pictures, the mean squared error of a mix is the mean of its squared errors, covariances of lights included."""
    weights = {"key": 0.5, "fill": 2.0, "sky": 4.0, "rest": 0.0}
    made = [relight(picture(seed=seed, spp=8), weights) for seed in range(40)]
    pixels = np.stack([image.pixels[..., :3] for image in made]).astype(np.float64)
    told = np.mean([errors_of(image) ** 2 for image in made], axis=0)
    seen = pixels.var(axis=0, ddof=1)
    lit_pixels = seen > 1e-12
    assert told[lit_pixels].sum() / seen[lit_pixels].sum() == pytest.approx(1, abs=0.12)
    # Of t with one degree of freedom, 95 % are within 12.7 errors, 50 % within 1.
    truth = pixels.mean(axis=0)
    errors = np.stack([errors_of(image) for image in made])
    within = np.abs(pixels - truth)[:, lit_pixels] <= errors[:, lit_pixels]
    assert 0.45 <= within.mean() <= 0.55


def test_parts_are_the_same_for_all_threads_lanes_and_merges(tmp_path: Path) -> None:
    stage = stage_of(ROOM + KEY + FILL)
    whole = render(stage, settings(spp=32, threads=2), progress=False)
    files = []
    for number, sample_range in enumerate(((0, 16), (16, 32))):
        file = tmp_path / f"{number}.prc"
        part = settings(spp=None, sample_range=sample_range)
        render(stage, part, progress=False, checkpointing=Checkpointing(file))
        files.append(file)
    merged = merge(files).image
    assert LightMix.of(merged).names == LightMix.of(whole).names
    for name, aov in whole.aovs.items():
        assert np.array_equal(merged.aovs[name].values, aov.values)
        held = merged.aovs[name].differences
        assert held is not None
        assert aov.differences is not None
        assert np.array_equal(held, aov.differences)
    weights = {"key": 0.3, "sky": 2.0}
    assert np.array_equal(relight(merged, weights).pixels, relight(whole, weights).pixels)
    assert np.array_equal(errors_of(relight(merged, weights)), errors_of(relight(whole, weights)))


def test_files_hold_parts_and_their_lights(tmp_path: Path) -> None:
    image = picture()
    image.save(tmp_path / "room.exr")
    again = LightMix.of(tmp_path / "room.exr")
    for part, other in zip(LightMix.of(image).parts, again.parts, strict=True):
        assert part.name == other.name
        assert part.paths == other.paths
        assert np.array_equal(part.light, other.light)
        assert np.array_equal(part.difference, other.difference)
    mixed = again.mixed({"key": 0.5})
    mixed.save(tmp_path / "mix.exr")
    assert np.array_equal(read_image(tmp_path / "mix.exr").pixels, mixed.pixels)
    assert read_image(tmp_path / "mix.exr").metadata["relight.key"] == "0.5 0.5 0.5"


def test_groups_are_one_part_and_lights_of_one_name_are_told_apart() -> None:
    grouped = lamp("a", more='    string karma:light:lpetag = "warm"\n') + lamp(
        "b", more='    string karma:light:lpetag = "warm"\n'
    )
    nested = "".join(f'def Xform "{name}"\n{{\n{lamp("bulb")}\n}}\n' for name in ("left", "right"))
    mix = LightMix.of(picture(ROOM + grouped + nested))
    assert mix.names == ("warm", "left_bulb", "right_bulb", "sky", "rest")
    assert mix.parts[0].paths == ("/a", "/b")


def test_more_lights_than_outputs_are_told_and_in_the_rest() -> None:
    lamps = "".join(lamp(f"lamp{k}", place=f"({k % 6 - 3}, {k // 6 - 3}, 5)") for k in range(36))
    image = picture(ROOM + lamps)
    mix = LightMix.of(image)
    assert len(mix.parts) == 32
    assert mix.share_of(mix.parts[-1]) > 0
    assert np.array_equal(mix.mixed({}).pixels, image.pixels)
    [told] = [d for d in image.report["diagnostics"] if d["code"] == "light-parts"]
    assert "lights.rest" in told["message"]


def test_a_light_that_emits_nothing_is_told() -> None:
    image = picture(ROOM + KEY + lamp("off").replace("inputs:intensity = 20", "inputs:intensity = 0"))
    assert "off" not in LightMix.of(image).names
    assert [d["prim_path"] for d in image.report["diagnostics"] if d["code"] == "light-parts"] == ["/off"]


def test_a_kept_scene_has_parts_after_edits() -> None:
    stage = stage_of(ROOM + KEY + FILL)
    scene = Scene(stage)
    scene.render(settings(), progress=False)
    stage.GetPrimAtPath("/fill").GetAttribute("inputs:intensity").Set(5.0)
    kept = scene.render(settings(), progress=False)
    fresh = render(stage, settings(), progress=False)
    for name, aov in fresh.aovs.items():
        assert np.array_equal(kept.aovs[name].values, aov.values)


def test_a_fit_finds_the_weights_of_the_reference() -> None:
    mix = LightMix.of(picture(spp=64))
    wanted = {"key": 0.4, "fill": 2.0, "sky": 1.5}
    reference = render(stage_of(lit(0.4, 2, (1.5, 1.5, 1.5)), light=""), settings(spp=256, seed=8), progress=False)
    found = fit(mix, reference)
    for name, weight in wanted.items():
        [value], [low], [high] = found.weights[name].value, found.weights[name].low, found.weights[name].high
        assert value == pytest.approx(weight, rel=0.05)
        assert low - 0.03 <= weight <= high + 0.03
    assert found.residual < 0.2


def test_a_fit_is_not_biased_by_the_noise_of_the_parts() -> None:
    """Plain least squares shrinks weights of noisy parts: the mean of many fits must not."""
    reference = relight(picture(spp=1024, seed=99), {"key": 2.0, "sky": 0.7, "fill": 1.3})
    found = [fit(LightMix.of(picture(spp=2, seed=seed)), reference).weights["key"].value[0] for seed in range(24)]
    assert np.mean(found) == pytest.approx(2, abs=4 * np.std(found, ddof=1) / len(found) ** 0.5 + 0.02)


def test_unknown_lights_and_pictures_without_parts_are_errors() -> None:
    mix = LightMix.of(picture())
    for weights, code in (
        ({"keys": 1.0}, "lights-unknown"),
        ({"key": -1.0}, "lights-weight"),
        ({"key": (1.0, 2.0)}, "lights-weight"),
        ({"key": 1e300}, "lights-weight"),
        ({"key": "half"}, "lights-weight"),
        ({"key": None}, "lights-weight"),
        ({"key": ("a", 1, 2)}, "lights-weight"),
    ):
        with pytest.raises(SettingsError) as caught:
            mix.mixed(weights)  # type: ignore[arg-type]
        assert caught.value.code == code
    with pytest.raises(SettingsError) as caught:
        LightMix.of(picture(aovs=()))
    assert caught.value.code == "lights-missing"


def test_a_mix_has_its_own_error_in_its_header_and_weights_may_be_arrays(tmp_path: Path) -> None:
    mix = LightMix.of(picture())
    changed = mix.mixed({"key": np.array([4.0, 2.0, 0.0])})
    assert np.array_equal(changed.pixels, mix.mixed({"key": (4, 2, 0)}).pixels)
    changed.save(tmp_path / "mix.exr")
    header = read_image(tmp_path / "mix.exr").metadata
    told = {key: value for key, value in header.items() if key.startswith("error.")}
    assert set(told) == {"error.relmse.estimate", "error.relmse.ci95"}
    assert float(told["error.relmse.estimate"]) == pytest.approx(changed.report["error"]["relmse"]["estimate"])


def test_halves_keep_the_pictures_bits(tmp_path: Path) -> None:
    picture().save(tmp_path / "half.exr", half=["all"])
    mix = LightMix.of(tmp_path / "half.exr")
    assert np.array_equal(mix.mixed({}).pixels, mix.image.pixels)
    assert not mix.keeps_light


def test_where_a_picture_has_less_light_than_its_lights_so_has_the_mix() -> None:
    """As in the shadow on an invisible ground, in front of a dome that is seen."""
    image = picture()
    shade = np.linspace(0.2, 1, SIZE[0])[None, :, None]
    dark = replace(
        image, pixels=np.concatenate([image.pixels[..., :3] * shade, image.pixels[..., 3:]], axis=2).astype(np.float32)
    )
    weights = {"key": 0.0, "sky": 3.0}
    mixed = LightMix.of(dark).mixed(weights)
    assert (mixed.pixels >= 0).all()
    np.testing.assert_allclose(mixed.pixels[..., :3], relight(image, weights).pixels[..., :3] * shade, rtol=3e-3, atol=1e-6)


def test_a_fit_leaves_out_what_no_light_makes_and_refuses_other_spaces_and_regions() -> None:
    image = picture(spp=64)
    left = (np.arange(SIZE[0]) < SIZE[0] / 2)[None, :, None]
    plate = replace(image, pixels=np.where(left, image.pixels + np.array([5.0, 2.0, 1.0, 0.0], np.float32), image.pixels))
    mix = LightMix.of(plate)
    found = fit(mix, mix.mixed({"key": 2.0, "fill": 0.5}))
    assert found.weights["key"].value[0] == pytest.approx(2, rel=0.1)
    assert found.weights["fill"].value[0] == pytest.approx(0.5, rel=0.1)
    one_half, other_half = (picture(spp=2, region=(low, 0.0, low + 0.5, 1.0)) for low in (0.0, 0.5))
    other = picture(spp=2, rendering_color_space="lin_ap1_scene")
    for one, reference in ((one_half, other_half), (picture(spp=2), other)):
        with pytest.raises(SettingsError) as caught:
            fit(LightMix.of(one), reference)
        assert caught.value.code == "lights-fit"


def test_a_layers_samples_stay_where_they_are_under_any_rate(tmp_path: Path) -> None:
    text = "#usda 1.0\n(\n    timeCodesPerSecond = 30\n)\n"
    text += 'def SphereLight "key"\n{\n    float inputs:intensity.timeSamples = { 1: 1, 31: 31 }\n}\n'
    (tmp_path / "shot.usda").write_text(text)
    written, left_out = usd.weight_layer(Usd.Stage.Open(str(tmp_path / "shot.usda")), {"/key": (2.0, 2.0, 2.0)})
    (tmp_path / "mix.usda").write_text(written)
    rate = "    timeCodesPerSecond = 30\n    subLayers = [@mix.usda@, @shot.usda@]\n"
    (tmp_path / "top.usda").write_text(f"#usda 1.0\n(\n{rate})\n")
    top = Usd.Stage.Open(str(tmp_path / "top.usda"))
    intensity = top.GetPrimAtPath("/key").GetAttribute("inputs:intensity")
    assert not left_out
    assert [intensity.Get(time) for time in (1, 11, 31)] == [2, 22, 62]


def test_the_command_writes_pictures_a_report_and_a_layer_that_renders_the_mix(tmp_path: Path, capsys: Any) -> None:
    stage = tmp_path / "room.usda"
    held = stage_of(ROOM + KEY + FILL)
    held.GetRootLayer().Export(str(stage))
    exr, mixed, layer = tmp_path / "room.exr", tmp_path / "mix.exr", tmp_path / "mix.usda"
    common = ["--res", "24", "18", "--spp", "256"]
    assert run(["render", str(stage), *common, "--aov", "lights", "-o", str(exr)]) == 0
    capsys.readouterr()
    asked = ["-l", "key=0.5", "-l", "sky=1,0.5,0.25", "--stops", "fill=+1"]
    outputs = ["-o", str(mixed), "--layer", str(layer), "--stage", str(stage), "--report", str(tmp_path / "mix.json")]
    assert run(["relight", str(exr), *asked, *outputs]) == 0
    assert "key" in capsys.readouterr().out
    report = json.loads((tmp_path / "mix.json").read_text())
    assert {row["name"]: row["weight"] for row in report["lights"]}["fill"] == [2, 2, 2]
    over = Usd.Stage.Open(str(layer))
    assert over.GetPrimAtPath("/key").GetAttribute("inputs:intensity").Get() == 10
    top = tmp_path / "top.usda"
    top.write_text(f"#usda 1.0\n(\n    subLayers = [@{layer}@, @{stage}@]\n)\n")
    assert run(["render", str(top), *common, "--seed", "4", "-o", str(tmp_path / "again.exr")]) == 0
    assert compare(mixed, tmp_path / "again.exr", tolerance=0.1).verdict.value == "unchanged"


def test_a_layer_of_the_stage_is_not_overwritten(tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    room = stage_of(ROOM + KEY + FILL)  # its layer goes with it
    room.GetRootLayer().Export("room.usda")
    Path("top.usda").write_text("#usda 1.0\n(\n    subLayers = [@room.usda@]\n)\n")
    picture(spp=2).save("room.exr")
    before = Path("room.usda").read_bytes()
    assert run(["relight", "room.exr", "-l", "key=2", "--layer", "room.usda", "--stage", "top.usda"]) == 2
    assert "a file that the command reads" in capsys.readouterr().err
    assert Path("room.usda").read_bytes() == before


VARIED = """#usda 1.0
(
    upAxis = "Y"
)
def Xform "rig" (
    payload = @./lamps.usda@
    variants = {
        string look = "day"
    }
    prepend variantSets = "look"
)
{
    variantSet "look" = {
        "day" {
            def SphereLight "key"
            {
                float inputs:intensity = 3
            }
        }
        "night" {
            def SphereLight "key"
            {
                float inputs:intensity = 20
            }
            def SphereLight "moon"
            {
            }
        }
    }
}
def Camera "eye"
{
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "ball"
{
}
"""
LAMPS = """#usda 1.0
(
    defaultPrim = "lamps"
)
def "lamps"
{
    def SphereLight "rim"
    {
        float inputs:intensity = 7
    }
}
"""
SESSION = """#usda 1.0
over "rig"
{
    over "moon"
    {
        float inputs:intensity = 50
    }
}
"""


def test_the_layer_is_of_the_stage_as_it_was_rendered(tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.usda").write_text(VARIED)
    Path("lamps.usda").write_text(LAMPS)
    Path("session.usda").write_text(SESSION)
    as_rendered = ["--variant", "/rig:look=night", "--session-layer", "session.usda"]
    small = ["--res", "8", "6", "--spp", "2", "--aov", "lights", "-o", "rig.exr"]
    assert run(["render", "rig.usda", *small, *as_rendered]) == 0
    capsys.readouterr()
    relit = ["relight", "rig.exr", *(word for name in ("key", "moon", "rim") for word in ("-l", f"{name}=2"))]
    assert run([*relit, "--stage", "rig.usda", "--layer", "mix.usda", "--report", "mix.json"]) == 0
    over = Usd.Stage.Open("mix.usda")
    values = {name: over.GetPrimAtPath(f"/rig/{name}") for name in ("key", "rim", "moon")}
    assert {n: p.GetAttribute("inputs:intensity").Get() for n, p in values.items() if p} == {"key": 40, "rim": 14}
    assert "session layer" in json.loads(Path("mix.json").read_text())["left_out"]["/rig/moon"]
    Path("session.usda").unlink()
    assert run([*relit, "--stage", "rig.usda", "--layer", "again.usda"]) in (2, 3)
    assert "session.usda" in capsys.readouterr().err
    assert not Path("again.usda").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-l", "key"], "NAME=0.5"),
        (["--stops", "key=1,2,3"], "NAME=+1"),
        (["--only", "key , sun"], "no light 'sun'"),
        (["--only", " ,"], "--only names no light"),
        (["--without", ""], "--without names no light"),
        (["--turn-spp", "4"], "--turn"),
        (["--fit-colors"], "--fit"),
        (["--layer", "x.usda"], "--stage"),
        (["-o", "room.exr"], "overwrite"),
        (["-l", "key=2", "--layer", "mix.usdc", "--stage", "other.usda"], ".usda or .usd"),
        (["-l", "key=2", "--layer", "mix.usda", "--stage", "other.usda"], "no light can be written: /key: the stage has no"),
    ],
)
def test_bad_arguments_are_errors(tmp_path: Path, capsys: Any, monkeypatch: Any, arguments: list[str], said: str) -> None:
    monkeypatch.chdir(tmp_path)
    picture(spp=2).save("room.exr")
    Path("other.usda").write_text("#usda 1.0\n")
    assert run(["relight", "room.exr", *arguments]) == 2
    assert not list(tmp_path.glob("mix.*"))
    assert said in capsys.readouterr().err
