"""Formats of data sets, read by what reads them: pycocotools, h5py, and readers of KITTI, BOP and YOLO."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from primray.dataset import Config, make, samples_of
from primray.dataset.packing import Sample, read_integers
from primray.dataset.writers import bop, kitti
from primray.errors import PrimrayError, SettingsError
from primray.images.image import write_png

from .room import config_in, plain_config

FORMATS = ["coco", "kitti", "bop", "yolo", "hdf5"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("yaml", reason="no PyYAML")
    pytest.importorskip("pycocotools", reason="no pycocotools")
    pytest.importorskip("h5py", reason="no h5py")
    folder = tmp_path_factory.mktemp("set")
    settings = {**plain_config()["settings"], "resolution": [48, 36]}
    config = config_in(folder, labels={"classes": ["ball", "box"]}, settings=settings, write=FORMATS)
    make(config, folder / "out")
    return folder / "out"


def visible(sample: Sample) -> list[tuple[dict[str, Any], np.ndarray[Any, Any]]]:
    """Things with masks that are compared with the ids of the AOV, not with the index map."""
    ids = sample.aov("object_instance:class")[..., 0]
    found = [(thing, ids == thing["id"]) for thing in sample.things]
    return [(thing, mask) for thing, mask in found if mask.any()]


def test_the_index_map_is_of_the_ids(made: Path) -> None:
    for sample in samples_of(made):
        assert visible(sample)
        for place, thing in enumerate(sample.things):
            mask = sample.aov("object_instance:class")[..., 0] == thing["id"]
            assert np.array_equal(sample.mask(place), mask)


def test_pycocotools_reads_masks_boxes_and_classes(made: Path) -> None:
    from pycocotools.coco import COCO

    coco = COCO(str(made / "coco/annotations.json"))
    assert {c["id"]: c["name"] for c in coco.loadCats(coco.getCatIds())} == {1: "ball", 2: "box"}
    assert min(coco.getAnnIds()) == 1
    for sample in samples_of(made):
        (image,) = coco.loadImgs([sample.index + 1])
        assert (image["width"], image["height"]) == sample.resolution
        assert (made / "coco" / image["file_name"]).read_bytes() == sample.file("picture").read_bytes()
        found = {a["path"]: a for a in coco.loadAnns(coco.getAnnIds(imgIds=[image["id"]]))}
        assert set(found) == {thing["path"] for thing, _ in visible(sample)}
        for thing, mask in visible(sample):
            annotation = found[thing["path"]]
            assert np.array_equal(coco.annToMask(annotation).astype(bool), mask)
            assert annotation["area"] == mask.sum()
            assert annotation["category_id"] == {"ball": 1, "box": 2}[thing["class"]]
            x0, y0, x1, y1 = thing["box_tight"]
            assert annotation["bbox"] == [x0, y0, x1 - x0, y1 - y0]


def test_perfect_results_have_an_average_precision_of_1(made: Path, tmp_path: Path) -> None:
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    coco = COCO(str(made / "coco/annotations.json"))
    results = [
        {"image_id": a["image_id"], "category_id": a["category_id"], "segmentation": a["segmentation"], "score": 1.0}
        for a in coco.loadAnns(coco.getAnnIds())
    ]
    judged = COCOeval(coco, coco.loadRes(results), "segm")
    judged.evaluate()
    judged.accumulate()
    judged.summarize()
    assert judged.stats[0] == 1.0


def test_yolo_boxes_are_those_of_the_masks(made: Path) -> None:
    import yaml

    root = made / "yolo"
    says = yaml.safe_load((root / "data.yaml").read_text())
    assert says["names"] == {0: "ball", 1: "box"}
    for sample in samples_of(made):
        image = root / says["train"] / f"{sample.name}.png"
        assert image.exists()
        label = Path(str(image).replace("/images/", "/labels/")).with_suffix(".txt")
        rows = [line.split() for line in label.read_text().splitlines()]
        width, height = sample.resolution
        found = set()
        for name, *numbers in rows:
            x, y, w, h = map(float, numbers)
            box = ((x - w / 2) * width, (y - h / 2) * height, (x + w / 2) * width, (y + h / 2) * height)
            found.add((says["names"][int(name)], *(round(value, 4) for value in box)))
        assert found == {(thing["class"], *thing["box_tight"]) for thing, _ in visible(sample)}


def test_h5py_reads_arrays_and_records(made: Path) -> None:
    import h5py

    with h5py.File(made / "hdf5/dataset.h5") as file:
        for sample in samples_of(made):
            assert json.loads(file["records"][sample.index]) == sample.record
            assert np.array_equal(file["picture"][sample.index], read_integers(sample.file("picture")))
            assert np.array_equal(file["things"][sample.index][..., 0], sample.index_map)
            assert np.array_equal(file["depth"][sample.index], sample.aov("depth"))
        assert file["depth"].chunks == (1, 36, 48, 1)


def test_packing_again_makes_the_same_bytes(made: Path) -> None:
    from primray.dataset.lock_file import read_lock
    from primray.dataset.packing import pack

    config = Config.parse((made / "dataset.yaml").read_text(), made.parent)
    before = {p: p.read_bytes() for name in FORMATS for p in sorted((made / name).rglob("*")) if p.is_file()}
    lock = read_lock(made)
    assert lock is not None
    pack(config, lock, made)
    after = {p: p.read_bytes() for name in FORMATS for p in sorted((made / name).rglob("*")) if p.is_file()}
    assert before == after
    assert len(before) > 20


def read_kitti(path: Path) -> list[dict[str, Any]]:
    """The 15 columns of devkit_object's readme."""
    found = []
    for line in path.read_text().splitlines():
        kind, *words = line.split(" ")
        assert len(words) == 14
        n = list(map(float, words))
        found.append(
            {"type": kind, "truncated": n[0], "occluded": int(n[1]), "alpha": n[2], "box": n[3:7], "hwl": n[7:10]}
            | {"place": np.array(n[10:13]), "turn": n[13]}
        )
    return found


def corners_of_kitti(row: dict[str, Any]) -> np.ndarray[Any, Any]:
    """R = [[c, 0, s], [0, 1, 0], [-s, 0, c]] of x +-l/2, y 0 and -h, z +-w/2, as the devkit's computeBox3D."""
    h, w, length = row["hwl"]
    c, s = math.cos(row["turn"]), math.sin(row["turn"])
    own = np.array([[x, y, z] for x in (-length / 2, length / 2) for y in (0, -h) for z in (-w / 2, w / 2)])
    turned: np.ndarray[Any, Any] = own @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + row["place"]
    return turned


def test_kitti_has_a_line_for_each_thing_with_its_box(made: Path) -> None:
    for sample in samples_of(made):
        rows = read_kitti(made / f"kitti/training/label_2/{sample.name}.txt")
        assert [row["type"] for row in rows] == [thing["class"] for thing, _ in visible(sample)]
        for row, (thing, _) in zip(rows, visible(sample), strict=True):
            assert row["box"] == pytest.approx([value - 0.5 for value in thing["box_tight"]], abs=0.01)
        calibration = dict(
            line.split(": ") for line in (made / f"kitti/training/calib/{sample.name}.txt").read_text().splitlines()
        )
        p2 = np.array(calibration["P2"].split(), float).reshape(3, 4)
        assert p2[:, :3] == pytest.approx(np.array(sample.record["camera"]["intrinsics"]))


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.0, 3.1])
def test_kitti_boxes_of_level_things_have_their_corners(turn: float) -> None:
    size = np.array([4.0, 1.5, 2.0])  # x, y, z of the box: length, height, width
    c, s = math.cos(turn), math.sin(turn)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.diag([1, -1, -1])  # the box's own y is up
    pose[:3, 3] = 3, 1, 20
    upright = kitti.upright_box(pose, size)
    assert not upright[3]
    thing = {"class": "a car", "truncation": 0.25, "occlusion": 0.2, "box_tight": [1, 2, 3, 4]}
    line = kitti.line_of(thing, upright, 1.0)
    path_row = line.split(" ")
    assert path_row[:3] == ["a_car", "0.25", "1"]
    n = list(map(float, path_row[1:]))
    row = {"hwl": n[7:10], "place": np.array(n[10:13]), "turn": n[13]}
    assert row["hwl"] == pytest.approx([1.5, 2, 4], abs=1e-3)
    own = np.array([[x, y, z] for x in (-2, 2) for y in (-0.75, 0.75) for z in (-1, 1)])
    expected = own @ pose[:3, :3].T + pose[:3, 3]
    found = corners_of_kitti(row)
    nearest = np.linalg.norm(found[:, None] - expected[None], axis=2).min(axis=1)
    assert nearest.max() < 1e-3
    assert n[2] == pytest.approx(kitti.wrapped(n[13] - math.atan2(3, 20)), abs=1e-3)


def test_kitti_boxes_of_pitched_things_hold_them() -> None:
    a = 0.4
    tilt = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = tilt @ np.diag([1, -1, -1]), (1, 2, 9)
    bottom, (height, width, length), turn, loosened = kitti.upright_box(pose, np.array([4.0, 1.0, 2.0]))
    assert loosened
    found = corners_of_kitti({"hwl": [height, width, length], "place": bottom, "turn": turn})
    own = np.array([[x, y, z] for x in (-2, 2) for y in (-0.5, 0.5) for z in (-1, 1)])
    inside = own @ pose[:3, :3].T + pose[:3, 3]
    assert (found.min(0) <= inside.min(0) + 1e-9).all()
    assert (found.max(0) >= inside.max(0) - 1e-9).all()


def test_bop_rotations_have_no_scale_and_sheared_things_none() -> None:
    turn = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)
    found = bop.rotation_of(turn @ np.diag([2, 3, 0.5]))
    assert found is not None
    assert np.allclose(found, turn)
    assert bop.rotation_of(np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]])) is None
    assert bop.rotation_of(np.diag([1.0, 1, -1])) is None


def test_bop_depths_are_millimetres_along_z(made: Path) -> None:
    scene = made / "bop/train_pbr/000000"
    cameras = json.loads((scene / "scene_camera.json").read_text())
    for sample in samples_of(made):
        camera = cameras[str(sample.index)]
        stored = read_integers(scene / f"depth/{sample.name}.png")[..., 0]
        depth = sample.aov("depth")[..., 0]
        there = np.isfinite(depth) & (depth < 1e6)
        assert there.any()
        assert np.abs(stored[there] * camera["depth_scale"] - depth[there] * 1000).max() <= camera["depth_scale"]
        assert not stored[~there].any()
        assert np.array(camera["cam_K"]).reshape(3, 3) == pytest.approx(np.array(sample.record["camera"]["intrinsics"]))


def test_bop_poses_lead_to_where_the_mask_is(made: Path) -> None:
    """The model's origin, by cam_K, R and t as BOP defines them, is in the middle of the things' boxes."""
    scene = made / "bop/train_pbr/000000"
    poses, infos, cameras = (json.loads((scene / f"scene_{name}.json").read_text()) for name in ("gt", "gt_info", "camera"))
    counted = 0
    for sample in samples_of(made):
        for number, (pose, info) in enumerate(zip(poses[str(sample.index)], infos[str(sample.index)], strict=True)):
            mask = read_integers(scene / f"mask_visib/{sample.name}_{number:06d}.png")[..., 0]
            assert mask.max() <= 255
            assert int((mask > 0).sum()) == info["px_count_visib"]
            x, y, w, h = info["bbox_visib"]
            if info["px_count_visib"] == 0:
                continue
            there = np.argwhere(mask)
            assert [x, y] == there[:, ::-1].min(0).tolist()
            assert [w, h] == (there.max(0) - there.min(0))[::-1].tolist()  # no + 1, as bop_toolkit's calc_2d_bbox
            if min(x, y) > 0 and x + w < 47 and y + h < 35 and info["px_count_visib"] == info.get("px_count_all"):
                k = np.array(cameras[str(sample.index)]["cam_K"]).reshape(3, 3)
                at = k @ np.array(pose["cam_t_m2c"])
                assert x <= at[0] / at[2] <= x + w
                assert y <= at[1] / at[2] <= y + h
                counted += 1
    assert counted


def test_bop_boxes_of_whole_things_are_of_pixels() -> None:
    assert bop.whole_pixels([2.0, 3.0, 3.0, 4.0]) == [2, 3, 0, 0]  # one pixel has width 0, as bop_toolkit's
    assert bop.whole_pixels([-1.5, 2.25, 4.5, 6.0]) == [-2, 2, 6, 3]


def test_kitti_boxes_hold_the_corners_of_the_3d_boxes(made: Path) -> None:
    for sample in samples_of(made):
        rows = read_kitti(made / f"kitti/training/label_2/{sample.name}.txt")
        for row, (thing, _) in zip(rows, visible(sample), strict=True):
            pose, half = np.array(thing["box_3d"]["camera_from_box"]), np.array(thing["box_3d"]["size"]) / 2
            own = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            inside, corners = own @ pose[:3, :3].T + pose[:3, 3], corners_of_kitti(row)
            c, s = math.cos(row["turn"]), math.sin(row["turn"])
            back = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
            for end in (np.min, np.max):
                reach = end(corners @ back, axis=0), end(inside @ back, axis=0)
                assert reach[0] == pytest.approx(reach[1], abs=2e-3)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"write": ["coco"], "labels": None}, "coco needs labels"),
        ({"write": ["bop"], "labels": {}, "pictures": ["png"]}, "bop needs npy among the pictures"),
        ({"write": ["bop"], "labels": {}, "settings": {"spp": 1}}, "bop needs the AOV depth"),
        ({"write": {"hdf5": {"levle": 3}}}, "did you mean level"),
        (
            {"write": ["kitti"], "labels": {}, "settings": {"panorama": "lat-long"}},
            "kitti needs cameras with an intrinsic matrix",
        ),
    ],
)
def test_what_a_format_needs_is_said_ahead(tmp_path: Path, changes: dict[str, Any], says: str) -> None:
    with pytest.raises(SettingsError, match=says):
        config_in(tmp_path, **changes)


def test_a_format_of_pinholes_says_which_sample_is_none(tmp_path: Path) -> None:
    config = config_in(tmp_path, labels={"classes": ["ball", "box"]}, samples=1, write=["kitti"], vary=None)
    stage = tmp_path / "room.usda"
    parallel = 'def Camera "view"\n    {\n        token projection = "orthographic"\n    }\n    def SphereLight "lamp"'
    stage.write_text(stage.read_text().replace('def SphereLight "lamp"', parallel))
    with pytest.raises(SettingsError, match="KITTI needs cameras with an intrinsic matrix") as error:
        make(config, tmp_path / "out")
    assert error.value.where == "sample 0"


def test_a_set_without_things_is_one_that_readers_read(tmp_path: Path) -> None:
    import yaml

    labels = {"taxonomy": "nothing"}
    make(
        config_in(tmp_path, labels=labels, samples=1, write=["coco", "kitti", "bop", "yolo", "yolo-segment"]), tmp_path / "out"
    )
    assert yaml.safe_load((tmp_path / "out/yolo/data.yaml").read_text())["names"] == {}
    assert (tmp_path / "out/yolo-segment/labels/train/000000.txt").read_text() == ""
    assert json.loads((tmp_path / "out/bop/train_pbr/000000/scene_gt.json").read_text()) == {"0": []}
    assert json.loads((tmp_path / "out/bop/models/models_info.json").read_text()) == {}


def test_a_picture_that_ends_early_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "things.png"
    write_png(np.random.default_rng(0).integers(0, 65535, (64, 64, 1), dtype=np.uint16), path)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(PrimrayError) as raised:
        read_integers(path)
    assert (raised.value.code, raised.value.where) == ("dataset-damaged", str(path))
