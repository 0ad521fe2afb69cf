"""The sensor's moments are those of EMVA 1288, its files hold its numbers, and bad models are errors."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from primray import Image, RawImage, SensorModel, read_image
from primray.cli import run
from primray.errors import SettingsError
from primray.sensor.files import dng


def card(value: float, size: tuple[int, int] = (8, 8), error: float | None = 0.0) -> Image:
    """Return a grey card (H, W) of one value."""
    pixels = np.ones((*size[::-1], 4), np.float32)
    pixels[..., :3] = value
    errors = None if error is None else np.full((*size[::-1], 3), error, np.float32)
    return Image(pixels, errors=errors)


@pytest.mark.parametrize("value", [0.0, 0.003, 0.05, 0.6])
def test_the_moments_of_a_thousand_frames_of_a_grey_card_follow_the_model(value: float) -> None:
    """64,000 numbers: means to 1 % of a deviation and variances to 4.5 standard errors (2.5 %)."""
    model = SensorModel(full_well=10000, read_noise=4, dark_current=20, exposure_time=0.5, bits=14, black_level=800, seed=11)
    frames = np.stack([model.expose(card(value), frame).values for frame in range(1000)]).astype(np.float64)
    electrons = value / 1.2 * 10000
    mean = 800 + model.gain * (electrons + 10)
    variance = model.gain**2 * (electrons + 10 + 16) + 1 / 12
    assert frames.mean() == pytest.approx(mean, abs=4.5 * np.sqrt(variance / frames.size))
    assert frames.var() == pytest.approx(variance, rel=4.5 * np.sqrt(2.2 / frames.size))
    assert frames.mean(axis=0).std() == pytest.approx(np.sqrt(variance / 1000), rel=0.4)  # no pattern stays


def test_the_slope_of_variance_over_mean_is_the_gain() -> None:
    model = SensorModel(full_well=20000, read_noise=5, seed=2)
    means, variances = [], []
    for step, value in enumerate((0.05, 0.2, 0.4, 0.7, 1.0)):
        numbers = model.expose(card(value, (200, 200)), step).values.astype(np.float64)
        means.append(numbers.mean())
        variances.append(numbers.var())
    assert np.polyfit(means, variances, 1)[0] == pytest.approx(model.gain, rel=0.02)


def test_a_sensor_saturates_and_never_reads_below_nothing() -> None:
    model = SensorModel(read_noise=30, black_level=10)
    assert (model.expose(card(5.0)).values == model.white_level).all()
    assert model.expose(card(0.0, (100, 100))).values.min() == 0
    quiet = SensorModel(read_noise=0)
    assert (quiet.expose(card(0.0)).values == quiet.black_level).all()


def test_speed_is_gain_and_fewer_electrons() -> None:
    slow, fast = SensorModel(), SensorModel(iso=400)
    assert fast.electrons(card(0.3)).mean() == pytest.approx(slow.electrons(card(0.3)).mean() / 4)
    assert fast.gain == pytest.approx(4 * slow.gain)


def test_filters_let_their_colours_through() -> None:
    pixels = np.ones((4, 6, 4), np.float32)
    pixels[..., :3] = (0.1, 0.2, 0.4)
    image = Image(pixels)
    for mosaic in ("RGGB", "GRBG", "BGGR", "GBRG"):
        model = SensorModel(mosaic=mosaic)
        found = model.electrons(image) / model.electrons_per_unit
        wanted = np.array([{"R": 0.1, "G": 0.2, "B": 0.4}[letter] for letter in mosaic]).reshape(2, 2)
        assert np.allclose(found, np.tile(wanted, (2, 3)), rtol=1e-6)
    mono = SensorModel(mosaic="MONO")
    assert np.allclose(mono.electrons(image) / mono.electrons_per_unit, 0.2126 * 0.1 + 0.7152 * 0.2 + 0.0722 * 0.4, rtol=1e-6)


def test_noise_is_a_function_of_seed_frame_and_pixel() -> None:
    model = SensorModel(seed=4)
    first = model.expose(card(0.3)).values
    assert np.array_equal(first, model.expose(card(0.3)).values)
    assert not np.array_equal(first, model.expose(card(0.3), 1).values)
    assert not np.array_equal(first, SensorModel(seed=5).expose(card(0.3)).values)


def test_the_renders_own_noise_is_told() -> None:
    model = SensorModel(full_well=10000, read_noise=0)
    electrons = 0.6 / 1.2 * 10000
    error = np.sqrt(electrons) / 10 / model.electrons_per_unit  # a tenth of the shot noise
    assert model.expose(card(0.6, error=error)).render_share == pytest.approx(0.01, rel=1e-4)
    assert model.expose(card(0.6, error=None)).render_share is None
    assert model.error_of(np.sqrt(electrons) / 10) == pytest.approx(error)


def read_tiff(data: bytes) -> dict[int, list[int]]:
    """Return the fields of a little-endian TIFF's first directory; rationals as pairs."""
    sizes = {1: "B", 2: "B", 3: "H", 4: "I", 5: "II", 10: "ii"}
    assert data[:4] == b"II*\0"
    [at] = struct.unpack_from("<I", data, 4)
    [count] = struct.unpack_from("<H", data, at)
    found, before = {}, 0
    for entry in range(count):
        number, kind, values = struct.unpack_from("<HHI", data, at + 2 + 12 * entry)
        assert number > before, "fields ascend"
        before = number
        form = "<" + sizes[kind] * values
        place = at + 10 + 12 * entry
        if struct.calcsize(form) > 4:
            [place] = struct.unpack_from("<I", data, place)
            assert place % 2 == 0
        found[number] = list(struct.unpack_from(form, data, place))
    return found


def test_a_dng_holds_the_numbers_the_mosaic_and_the_colours() -> None:
    matrix = ((0.9, 0.1, 0.0), (0.2, 0.7, 0.1), (0.0, 0.2, 0.6))
    model = SensorModel(mosaic="GBRG", camera_from_rec709=matrix, bits=12, black_level=200)
    raw = model.expose(card(0.4, (6, 4)))
    data = dng(raw)
    assert data == dng(model.expose(card(0.4, (6, 4))))
    fields = read_tiff(data)
    assert (fields[256], fields[257], fields[258], fields[262]) == ([6], [4], [16], [32803])
    assert fields[33422] == [1, 2, 0, 1]
    assert (fields[50714], fields[50717]) == ([200], [4095])
    pixels = np.frombuffer(data, "<u2", 24, fields[273][0]).reshape(4, 6)
    assert np.array_equal(pixels, raw.values)
    assert fields[279] == [48]
    assert len(data) == fields[273][0] + 48
    colors = np.array(fields[50721]).reshape(9, 2)
    xyz_white = np.array([0.95046, 1.0, 1.08906])
    seen = (colors[:, 0] / colors[:, 1]).reshape(3, 3) @ xyz_white
    neutral = np.array(fields[50728]).reshape(3, 2)
    assert np.allclose(seen / seen.max(), neutral[:, 0] / neutral[:, 1], atol=1e-3)  # white is neutral


def test_rawpy_reads_the_dng(tmp_path: Path) -> None:
    rawpy = pytest.importorskip("rawpy", reason="skipped: no rawpy")
    raw = SensorModel(mosaic="BGGR").expose(card(0.4, (64, 48)))
    raw.save(tmp_path / "a.dng")
    with rawpy.imread(str(tmp_path / "a.dng")) as found:
        assert np.array_equal(found.raw_image, raw.values)
        assert found.raw_pattern.tolist() == [[2, 3], [1, 0]]
        assert found.black_level_per_channel[0] == 512
        assert found.white_level == 16383


@pytest.mark.parametrize("ending", ["png", "tif", "npy"])
def test_plain_files_hold_the_numbers(tmp_path: Path, ending: str) -> None:
    import OpenImageIO as oiio

    raw = SensorModel().expose(card(0.4))
    path = raw.save(tmp_path / f"a.{ending}")
    found = np.load(path) if ending == "npy" else np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.UINT16))[..., 0]
    assert np.array_equal(found, raw.values)


@pytest.mark.parametrize(
    "values",
    [
        {"full_well": 0},
        {"bits": 7},
        {"black_level": 1 << 14},
        {"mosaic": "RGBG"},
        {"iso": 50},
        {"read_noise": -1},
        {"seed": -1},
    ],
)
def test_sensors_that_cannot_be_are_errors(values: dict[str, Any]) -> None:
    with pytest.raises(SettingsError) as caught:
        SensorModel(**values)
    assert caught.value.code == "sensor"
    assert caught.value.where == next(iter(values))


def test_models_are_read_from_json(tmp_path: Path) -> None:
    file = tmp_path / "sensor.json"
    file.write_text(json.dumps(SensorModel(full_well=5000, mosaic="MONO").as_json()))
    assert SensorModel.read(file) == SensorModel(full_well=5000, mosaic="MONO")
    for text, said in (('{"fullwell": 3}', "full_well"), ('{"bits": "x"}', "bits"), ("[1]", "object"), ("{", "cannot be read")):
        file.write_text(text)
        with pytest.raises(SettingsError, match=said):
            SensorModel.read(file)


def test_the_command_writes_raw_files_and_says_what_to_render_to(tmp_path: Path, capsys: Any) -> None:
    card(0.5, (16, 12), error=0.1).save(tmp_path / "card.exr")
    arguments = [str(tmp_path / "card.exr"), "-o", str(tmp_path / "a.dng"), "-o", str(tmp_path / "a.npy"), "--set", "bits=12"]
    assert run(["sensor", *arguments, "--set", "black_level=64", "--frame", "3", "--report", str(tmp_path / "a.json")]) == 0
    assert "render with more samples" in capsys.readouterr().out
    wanted = SensorModel(bits=12, black_level=64).expose(read_image(tmp_path / "card.exr"), 3)
    assert np.array_equal(np.load(tmp_path / "a.npy"), wanted.values)
    assert json.loads((tmp_path / "a.json").read_text())["model"]["bits"] == 12
    assert run(["sensor", "--electrons", "2", "--set", "full_well=12000"]) == 0
    assert "--target-error 0.0002 --metric rmse" in capsys.readouterr().out
    for bad in (["--set", "bits"], ["--set", "wells=3"], ["-o", str(tmp_path / "a.jpg")], ["--frame", "-1"]):
        assert run(["sensor", str(tmp_path / "card.exr"), *bad]) == 2


def test_raw_images_are_read_only() -> None:
    raw = RawImage(np.zeros((2, 2), np.uint16), SensorModel())
    with pytest.raises(ValueError, match="read-only"):
        raw.values[0, 0] = 1
