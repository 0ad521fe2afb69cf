"""A pair's files: parts of one EXR that say whose they are, as OpenEXR wants it, or a file for each eye."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.errors import SettingsError
from primray.images.aov import Aov
from primray.images.image import EYE, Image
from primray.images.reading import read_image
from primray.render.stereo import StereoImage, is_joint, name_of_eye
from primray.settings import Eye


def picture(eye: str, seed: int) -> Image:
    values = np.random.default_rng(seed).random((5, 7, 7), np.float32)
    depth = Aov(values[..., :1], ("Z",), "depth", "how far")
    return Image(values[..., :4], metadata={EYE: eye, "seed": seed}, errors=values[..., 4:], aovs={"depth": depth})


@pytest.fixture
def pair() -> StereoImage:
    return StereoImage(picture("left", 1), picture("right", 2))


def parts_of(path: Path) -> list[tuple[str, str, Any, tuple[str, ...]]]:
    file = oiio.ImageInput.open(str(path))
    assert file is not None
    found: list[tuple[str, str, Any, tuple[str, ...]]] = []
    while file.seek_subimage(len(found), 0):
        s = file.spec()
        view = s.get_string_attribute("view")
        found.append((s.get_string_attribute("name"), view, s.getattribute("multiView"), tuple(s.channelnames)))
    return found


def test_both_in_one_file(pair: StereoImage, tmp_path: Path) -> None:
    [path] = pair.save(tmp_path / "a.exr")
    channels = ("R", "G", "B", "A", "stderr.R", "stderr.G", "stderr.B")
    assert parts_of(path) == [
        ("rgba.left", "left", None, channels),
        ("depth.left", "left", None, ("Z",)),
        ("rgba.right", "right", None, channels),
        ("depth.right", "right", None, ("Z",)),
    ]
    for eye, image in pair.views.items():
        found = read_image(path, eye)
        assert (found.pixels == image.pixels).all()
        assert found.errors is not None
        assert (found.errors == image.errors).all()
        assert list(found.aovs) == ["depth"]
        assert (found.aovs["depth"].values == image.aovs["depth"].values).all()
        assert found.metadata["seed"] == image.metadata["seed"]
    assert (read_image(path).pixels == pair.left.pixels).all()


def test_without_aovs(pair: StereoImage, tmp_path: Path) -> None:
    plain = StereoImage(replace(pair.left, aovs={}), replace(pair.right, aovs={}))
    [path] = plain.save(tmp_path / "a.exr")
    assert [part[:3] for part in parts_of(path)] == [("rgba.left", "left", None), ("rgba.right", "right", None)]


def test_a_file_for_each_eye(pair: StereoImage, tmp_path: Path) -> None:
    alone = StereoImage(replace(pair.left, aovs={}), pair.right)
    left, right = alone.save(tmp_path / "a.%V.exr")
    assert (left.name, right.name) == ("a.left.exr", "a.right.exr")
    assert [part[1:3] for part in parts_of(left)] == [("left", ("left",))]  # a part alone says it twice
    assert [part[1:3] for part in parts_of(right)] == [("right", None), ("right", None)]
    assert (read_image(right, "right").pixels == pair.right.pixels).all()
    with pytest.raises(SettingsError) as refusal:
        read_image(right, "left")
    assert refusal.value.code == "stereo-view"
    assert [path.name for path in pair.save(tmp_path / "a.png")] == ["a_left.png", "a_right.png"]


@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("shot.png", "shot_left.png"),
        ("out/shot.0001.jpg", "out/shot_left.0001.jpg"),
        ("shot.v2.png", "shot.v2_left.png"),
        ("%V/shot_%v.0001.png", "%V/shot_l.0001.png"),
        ("a.%V.exr", "a.left.exr"),
    ],
)
def test_names(name: str, left: str) -> None:
    assert name_of_eye(name, Eye.LEFT) == left
    assert not is_joint(name)
    assert is_joint("a/%V/shot.exr")


def test_eyes_of_different_size(pair: StereoImage) -> None:
    with pytest.raises(SettingsError) as refusal:
        StereoImage(pair.left, Image(np.zeros((5, 8, 4), np.float32)))
    assert refusal.value.code == "stereo-frames"
