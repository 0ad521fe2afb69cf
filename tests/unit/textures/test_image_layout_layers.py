"""Layers of files: parts, and groups of channels, by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.description import TextureFile
from primray.errors import AssetError
from primray.textures.texture import load_texture

Part = tuple[str, dict[str, float]]  # its name, and a value for each of its channels

ONE_PART: list[Part] = [("", {"R": 0.0, "G": 0.1, "B": 0.2, "diff.R": 0.3, "diff.G": 0.4, "diff.B": 0.5, "depth.Z": 0.6})]
PARTS: list[Part] = [
    ("beauty", {"R": 0.0, "G": 0.1, "B": 0.2, "A": 0.9}),
    ("diff", {"diff.R": 0.3, "diff.G": 0.4, "diff.B": 0.5}),
    ("left", {"R": 0.7, "G": 0.7, "B": 0.7, "spec.R": 0.25, "spec.G": 0.5, "spec.B": 0.75}),
    ("masks", {"u": 0.125, "v": 0.375}),
]
NO_PLAIN: list[Part] = [("", {f"{layer}.{c}": v for layer, v in (("aa", 0.1), ("rgba", 0.2), ("zz", 0.3)) for c in "RGB"})]
WITH_DEFAULT: list[Part] = [("first", {"R": 0.1, "G": 0.1, "B": 0.1}), ("default", {"R": 0.5, "G": 0.5, "B": 0.5})]


def write(path: Path, parts: list[Part]) -> str:
    specs = []
    for name, channels in parts:
        spec = oiio.ImageSpec(2, 2, len(channels), oiio.FLOAT)
        spec.channelnames = tuple(channels)
        if name:
            spec.attribute("oiio:subimagename", name)
        specs.append(spec)
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), tuple(specs))
    for number, ((_, channels), spec) in enumerate(zip(parts, specs, strict=True)):
        assert not number or out.open(str(path), spec, "AppendSubimage")
        assert out.write_image(np.broadcast_to(np.array(list(channels.values()), np.float32), (2, 2, len(channels))).copy())
    assert out.close()
    return str(path)


@pytest.mark.parametrize(
    ("parts", "layer", "expected"),
    [
        (ONE_PART, "", (0.0, 0.1, 0.2)),
        (ONE_PART, "diff", (0.3, 0.4, 0.5)),
        (ONE_PART, "depth", (0.6,)),
        (ONE_PART, "rgba", (0.0, 0.1, 0.2)),
        (ONE_PART, "diff.G", (0.4,)),
        (PARTS, "spec.B", (0.75,)),
        (PARTS, "masks.v", (0.375,)),
        (PARTS, "", (0.0, 0.1, 0.2, 0.9)),
        (PARTS, "beauty", (0.0, 0.1, 0.2, 0.9)),
        (PARTS, "diff", (0.3, 0.4, 0.5)),
        (PARTS, "left", (0.7, 0.7, 0.7)),
        (PARTS, "spec", (0.25, 0.5, 0.75)),
        (PARTS, "left.spec", (0.25, 0.5, 0.75)),
        (PARTS, "masks", (0.125, 0.375)),
        (NO_PLAIN, "", (0.2, 0.2, 0.2)),
        (NO_PLAIN, "zz", (0.3, 0.3, 0.3)),
        (WITH_DEFAULT, "", (0.5, 0.5, 0.5)),
    ],
)
def test_the_layer_that_is_named_is_read(parts: list[Part], layer: str, expected: tuple[float, ...], tmp_path: Path) -> None:
    found = load_texture(TextureFile(write(tmp_path / "l.exr", parts), "raw", layer=layer))
    assert found.pixels[1, 1] == pytest.approx(expected)


def test_a_layer_that_is_not_there_is_reported_with_those_that_are(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match=r"no layer 'dif'.*depth, diff"):
        load_texture(TextureFile(write(tmp_path / "l.exr", ONE_PART), "raw", layer="dif"))
    with pytest.raises(AssetError, match="it has no layers"):
        load_texture(TextureFile(write(tmp_path / "p.exr", [("", {"R": 1.0, "G": 1.0, "B": 1.0})]), "raw", layer="dif"))
