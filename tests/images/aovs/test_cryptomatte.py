"""Cryptomatte: masks are exact shares of the film's own samples, add up to alpha, and are what its readers decode."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import primray
from primray.checkpoints.checkpointing import Checkpointing
from primray.images.cryptomatte import hash_of

FEATURES = Path(__file__).resolve().parents[3] / "scenes" / "features"
SOURCES = ("crypto_object", "crypto_material", "crypto_asset")
HERE: dict[str, Any] = {"resolution": (48, 32), "progress": False, "seed": 3, "spp": 4}
HALF = """#usda 1.0
(upAxis = "Y")
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "kit" (kind = "component") {
    def Mesh "near" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-9, -9, 1), (9, -9, 1), (9, 9, 1), (-9, 9, 1)]
        uniform token subdivisionScheme = "none"
        rel material:binding = </glass>
    }
    def Mesh "f\u00e4r" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
        uniform token subdivisionScheme = "none"
    }
}
def Material "glass" {
    token outputs:surface.connect = </glass/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity = 0.3
        token inputs:opacityMode = "presence"
        token outputs:surface
    }
}
"""


def masks(aov: Any) -> dict[int, np.ndarray[Any, Any]]:
    """By the bits of ids."""
    found: dict[int, np.ndarray[Any, Any]] = {}
    ids, shares = np.ascontiguousarray(aov.values[..., 0::2]).view(np.uint32), aov.values[..., 1::2]
    for number in np.unique(ids[shares > 0]).tolist():
        found[number] = np.where(ids == number, shares, 0).sum(axis=2)
    return found


@pytest.mark.parametrize(
    "scene", ["nested-instancers", "camera-lens", "motion-wheel", "glass", "opacity-texture", "lens-flaws"]
)
def test_masks_add_up_to_alpha(scene: str) -> None:
    image = primray.render(str(FEATURES / scene / "scene.usda"), aovs=SOURCES, **HERE)
    plain = primray.render(str(FEATURES / scene / "scene.usda"), **HERE)
    assert image.report["pixels_sha256"] == plain.report["pixels_sha256"]
    for source in SOURCES:
        shares = image.aovs[source].values[..., 1::2].astype(np.float64)
        np.testing.assert_allclose(shares.sum(axis=2), image.pixels[..., 3], rtol=0, atol=1e-6)
        assert (np.diff(shares, axis=2) <= 0).all()  # the largest first


def test_shares_are_those_of_the_samples() -> None:
    """A pixel's masks are multiples of a sample's share, the same for any number of lanes' groupings, resumed or not."""
    image = primray.render(str(FEATURES / "camera-lens" / "scene.usda"), aovs=["crypto_object"], **HERE)
    alpha = image.pixels[..., 3]
    shares = image.aovs["crypto_object"].values[..., 1::2]
    counted = shares * 4
    np.testing.assert_allclose(counted, np.rint(counted), atol=1e-5)
    assert ((alpha > 0) & (shares[..., 0] < 1)).sum() > 0


def test_it_survives_a_resume(tmp_path: Path) -> None:
    stage = str(FEATURES / "camera-lens" / "scene.usda")
    whole = primray.render(stage, aovs=["crypto_object"], **HERE | {"spp": 8})
    primray.render(stage, checkpointing=Checkpointing(tmp_path / "a.prc"), **HERE)
    going_on = Checkpointing(tmp_path / "a.prc", resume=tmp_path / "a.prc")
    again = primray.render(stage, aovs=["crypto_object"], checkpointing=going_on, **HERE | {"spp": 8})
    np.testing.assert_array_equal(
        again.aovs["crypto_object"].values.view(np.uint32), whole.aovs["crypto_object"].values.view(np.uint32)
    )


def _decoded(path: Path, image: primray.Image, source: str, folder: Path) -> dict[str, np.ndarray[Any, Any]]:
    """By the names of the manifest, as `cryptomatte-api` reads a file of this layer alone."""
    api = pytest.importorskip("cryptomatte_api")
    file: Any = oiio.ImageInput.open(str(path))
    number = next(n for n in range(9) if file.seek_subimage(n, 0) and source in file.spec().channelnames[0].lower() + source)
    while file.spec(number).get_string_attribute("primray:source") != source:
        number += 1
    spec, values = file.spec(number), file.read_image(number, 0, 0, file.spec(number).nchannels, oiio.FLOAT)
    alone: Any = oiio.ImageSpec(spec.width, spec.height, spec.nchannels, oiio.FLOAT)
    alone.channelnames = spec.channelnames
    for attribute in spec.extra_attribs:
        if attribute.name.startswith("cryptomatte/"):
            alone.attribute(attribute.name, attribute.value)
    out: Any = oiio.ImageOutput.create(str(folder / "alone.exr"))
    assert out.open(str(folder / "alone.exr"), alone)
    assert out.write_image(values)
    assert out.close()
    [matte] = api.Cryptomatte.load(str(folder / "alone.exr"))
    found: dict[str, np.ndarray[Any, Any]] = matte.masks()
    return found


def test_presence_divides_what_covers(tmp_path: Path) -> None:
    (tmp_path / "s.usda").write_text(HALF, encoding="utf-8")
    image = primray.render(str(tmp_path / "s.usda"), aovs=SOURCES, resolution=(8, 8), spp=4, progress=False)
    found = masks(image.aovs["crypto_object"])
    assert {h: float(mask.mean()) for h, mask in found.items()} == pytest.approx(
        {hash_of("/kit/near"): 0.3, hash_of("/kit/fär"): 0.7}, abs=1e-6
    )
    materials = masks(image.aovs["crypto_material"])
    assert float(materials[hash_of("/glass")].mean()) == pytest.approx(0.3, abs=1e-6)
    assert float(materials[hash_of("default")].mean()) == pytest.approx(0.7, abs=1e-6)
    assert list(masks(image.aovs["crypto_asset"])) == [hash_of("/kit")]
    path = image.save(tmp_path / "a.exr", half=["all"])  # ids stay whole
    decoded = _decoded(path, image, "crypto_object", tmp_path)
    assert {name: float(np.asarray(mask).mean()) for name, mask in decoded.items()} == pytest.approx(
        {"/kit/near": 0.3, "/kit/fär": 0.7}, abs=1e-6
    )


def test_instances_have_names_of_their_own(tmp_path: Path) -> None:
    stage = str(FEATURES / "point-instancer" / "scene.usda")
    image = primray.render(stage, aovs=["crypto_asset"], **HERE)
    again = primray.render(stage, aovs=["crypto_asset"], **HERE | {"seed": 9})
    names = image.aovs["crypto_asset"].metadata["cryptomatte/f42029d/manifest"]
    assert "/field[6]" in names
    common = set(masks(image.aovs["crypto_asset"])) & set(masks(again.aovs["crypto_asset"]))
    assert len(common) > 3
    read = primray.read_image(image.save(tmp_path / "a.exr"))
    assert read.aovs["crypto_asset"].metadata == image.aovs["crypto_asset"].metadata
