"""Labelled things: one for each labelled prim as often as it is in the world, with ids, masks and boxes."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

import primray
from primray.images.cryptomatte import hash_of

from .things_stage import STAGE

SIZE = (300, 200)
CARS = ("/world/car0", "/world/car1", "/world/lot[0]", "/world/lot[2]")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("things") / "s.usda"
    path.write_text(STAGE)
    return path


@pytest.fixture(scope="module")
def image(path: Path) -> primray.Image:
    aovs = ["semantic:class", "object_instance:class", "crypto_object", "labels:class"]
    return primray.render(path, camera="/cam", aovs=aovs, resolution=SIZE, spp=64, progress=False)


def _things(image: primray.Image) -> dict[str, primray.Thing]:
    return {thing.path: thing for thing in image.things}


def test_each_labelled_prim_is_a_thing_as_often_as_it_is_in_the_world(image: primray.Image) -> None:
    wheels = {f"{car}/{wheel}" for car in CARS for wheel in ("w0", "w1")}
    others = {"/world/lot[1]/crown", "/world/apples[0]", "/world/apples[1]", "/dust"}
    things = _things(image)
    assert set(things) == {*CARS, *wheels, *others}
    assert {things[car].class_name for car in CARS} == {"car,vehicle"}
    assert {things[wheel].class_name for wheel in wheels} == {"wheel"}
    assert things["/world/apples[1]"].class_name == "apple"
    for wheel in wheels:
        assert things[wheel].parent == things[wheel.rpartition("/")[0]].id
    assert {things[name].parent for name in (*CARS, *others)} == {None}
    json.dumps(image.report)


def test_ids_are_hashes_of_paths(image: primray.Image) -> None:
    assert {thing.id for thing in image.things} == {hash_of(thing.path) for thing in image.things}
    aov = image.aovs["object_instance:class"]
    assert aov.values.dtype == np.uint32
    assert aov.ids == {thing.id: thing.path for thing in image.things}
    assert set(np.unique(aov.values)) == {0, *aov.ids}


def test_classes_of_a_stage_are_numbered_by_the_alphabet(image: primray.Image) -> None:
    aov = image.aovs["semantic:class"]
    assert aov.ids == {1: "apple", 2: "car,vehicle", 3: "crown", 4: "dust", 5: "wheel"}
    inner = image.aovs["object_instance:class"].values[..., 0]
    for thing in image.things:
        assert np.unique(aov.values[..., 0][inner == thing.id]).tolist() == [thing.class_id]
    assert (aov.values[..., 0][inner == 0] == 0).all()


def test_a_thing_has_the_pixels_of_those_that_it_holds(image: primray.Image) -> None:
    inner = image.aovs["object_instance:class"].values[..., 0]
    for thing in image.things:
        mask = image.mask_of(thing)
        y, x = np.nonzero(mask)
        assert thing.box_tight == (x.min(), y.min(), x.max() + 1, y.max() + 1)
        assert thing.pixels_visible == len(x)
    car = _things(image)["/world/car0"]
    assert image.mask_of(car).sum() > (inner == car.id).sum() > 0


def test_masks_are_those_of_cryptomatte(image: primray.Image) -> None:
    """A pixel whose Cryptomatte is covered by one object alone belongs to the thing that this object is in."""
    [manifest] = [v for k, v in image.aovs["crypto_object"].metadata.items() if k.endswith("/manifest")]
    names = {int(number, 16): name for name, number in json.loads(manifest).items()}
    values = image.aovs["crypto_object"].values
    ids, covers = values[..., 0].view(np.uint32), values[..., 1]
    checked = 0
    for name in CARS:
        inside = [number for number, text in names.items() if text.split("|")[0].startswith(name)]
        mask = image.mask_of(_things(image)[name])
        whole = np.isin(ids, inside) & (covers > 0.999)
        assert mask[whole].all()
        ranks = range(0, values.shape[2], 2)
        coverage = sum(float(values[..., k + 1][np.isin(values[..., k].view(np.uint32), inside)].sum()) for k in ranks)
        assert abs(mask.sum() - coverage) < 0.05 * coverage
        checked += int(whole.sum())
    assert checked > 2000


def test_labels_are_inherited_in_instances_of_instancers(image: primray.Image) -> None:
    boxes = {row["object"]: row["label"] for row in image.report["labels"]["boxes"]["labels:class"]}
    assert boxes["/world/lot[0]"] == "car,vehicle"
    assert boxes["/world/lot[0]/w0"] == "car,vehicle,wheel"


def test_what_is_asked_for_beside_the_picture_does_not_change_it(path: Path, image: primray.Image) -> None:
    plain = primray.render(path, camera="/cam", resolution=SIZE, spp=64, progress=False)
    assert plain.report["pixels_sha256"] == image.report["pixels_sha256"]
    assert "labels" not in plain.report


def test_a_taxonomy_that_nothing_bears_is_reported(path: Path) -> None:
    with pytest.warns(primray.RenderWarning, match="taxonomy clas: did you mean class"):
        image = primray.render(path, camera="/cam", aovs=["object_instance:clas"], resolution=(8, 8), spp=1, progress=False)
    assert [row["code"] for row in image.report["diagnostics"]].count("label-taxonomy") == 1
    assert image.things == ()
    assert not image.aovs["object_instance:clas"].values.any()


def test_a_file_has_the_ids(image: primray.Image, tmp_path: Path) -> None:
    again = primray.read_image(image.save(tmp_path / "a.exr"))
    for name in ("semantic:class", "object_instance:class"):
        assert again.aovs[name].ids == image.aovs[name].ids
        np.testing.assert_array_equal(again.aovs[name].values, image.aovs[name].values)


@pytest.mark.parametrize(
    ("source", "aov"),
    [
        ("semantic_segmentation", "semantic:class"),
        ("semantic:other", "semantic:other"),
        ("object_instance", "object_instance:class"),
        ("instance_segmentation", "object_instance:class"),
        ("bounding_box_2d_tight_fast", "object_instance:class"),
        ("BoundingBox3DSD", "object_instance:class"),
        ("instance_id_segmentation", "prim"),
        ("motion_vectors", "motion_backward"),
        ("distance_to_camera", "distance"),
        ("distance_to_image_plane", "depth"),
        ("normals", "normal"),
    ],
)
def test_names_of_omniverse_lead_to_them(source: str, aov: str, tmp_path: Path) -> None:
    order = f"""
def Scope "Render" {{
    def RenderSettings "s" {{
        rel products = </Render/p>
    }}
    def RenderProduct "p" {{
        rel orderedVars = </Render/v>
        rel camera = </cam>
    }}
    def RenderVar "v" {{
        string sourceName = "{source}"
    }}
}}
"""
    stage = tmp_path / "s.usda"
    stage.write_text(STAGE.replace("(\n", '(\n    renderSettingsPrimPath = "/Render/s"\n', 1) + order)
    with pytest.warns(primray.RenderWarning) if aov == "semantic:other" else nullcontext():
        image = primray.render(stage, resolution=(8, 8), spp=1, progress=False)
    assert [made.source for made in image.aovs.values()] == [aov]
    assert ("things" in image.report.get("labels", {})) == aov.startswith("object_instance")


def test_first_hits_are_those_of_the_render(path: Path, image: primray.Image) -> None:
    scene = primray.Scene(path)
    aovs = ["semantic:class", "object_instance:class", "labels:class"]
    seen = scene.first_hits(camera="/cam", aovs=aovs, resolution=SIZE)
    assert seen.things == image.things
    assert seen.report["labels"] == image.report["labels"]
    assert seen.resolution == image.resolution
    for name in aovs:
        assert np.array_equal(seen.aovs[name].values, image.aovs[name].values)
        assert seen.aovs[name].ids == image.aovs[name].ids
    thing = seen.things[0]
    assert np.array_equal(seen.mask_of(thing), image.mask_of(thing))


@pytest.mark.parametrize("aov", ["crypto_object", "samples", "C.*", "volume", "deep", "lights"])
def test_first_hits_have_nothing_that_is_made_of_light(path: Path, aov: str) -> None:
    with pytest.raises(primray.errors.SettingsError) as caught:
        primray.Scene(path).first_hits(camera="/cam", aovs=[aov], resolution=(8, 6))
    assert caught.value.code == "aov-needs-light"
    assert caught.value.where == "aovs"
