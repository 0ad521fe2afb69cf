"""YOLO's segments and poses, read as Ultralytics reads them: polygons by cv2.fillPoly, columns by kpt_shape."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from primray.dataset import make, samples_of
from primray.dataset.packing import Sample
from primray.dataset.writers import yolo_pose
from primray.dataset.writers.outlines import polygon_of

from .room import config_in, plain_config, write_room

KEYPOINTS = """
            token[] primray:keypoints = ["left_top", "right_top", "front"]
            point3f[] primray:keypoints:points = [(-0.25, 0.25, 0), (0.25, 0.25, 0), (0, 0, 0.25)]
            double size = 0.5"""
Mask = npt.NDArray[np.bool_]


def filled(polygon: npt.NDArray[np.float64], shape: tuple[int, int]) -> Mask:
    """Pixels whose middles a polygon holds, by the number of its edges to their right."""
    x, y = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    inside = np.zeros(shape, bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crosses = (y0 > y) != (y1 > y)
        if y0 != y1:
            inside ^= crosses & (x < x0 + (x1 - x0) * (y - y0) / (y1 - y0))
    return inside


def drawn(line: str, shape: tuple[int, int]) -> Mask:
    """What Ultralytics makes of a line of a label at the picture's own size: float32, cut off to whole pixels, fillPoly."""
    cv2 = pytest.importorskip("cv2", reason="no OpenCV")
    shares = np.array(line.split()[1:], np.float32).reshape(-1, 2)
    corners = (shares * np.array(shape[::-1], np.float32)).astype(np.int32)
    canvas = np.zeros(shape, np.uint8)
    cv2.fillPoly(canvas, [corners], 1)
    return canvas > 0


def overlap(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / (one | other).sum())


def ring() -> Mask:
    y, x = np.mgrid[:40, :50]
    distance = np.hypot(x - 25, y - 20)
    return np.asarray((distance < 17) & (distance > 8))


def random_masks() -> list[Mask]:
    chance = np.random.default_rng(5)
    sizes = [(int(h), int(w)) for h, w in chance.integers(1, 18, (60, 2))]
    return [chance.random(size) < density for size, density in zip(sizes, chance.random(60), strict=True)]


@pytest.mark.parametrize("mask", [ring(), np.eye(7, dtype=bool), np.ones((3, 1), bool), *random_masks()])
def test_polygons_hold_the_pixels_of_their_masks(mask: Mask) -> None:
    """Holes, parts, pixels that share a corner, and borders; none of them costs a pixel where polygons are filled exactly."""
    polygon = polygon_of(mask)
    assert np.array_equal(filled(polygon, mask.shape), mask)
    if mask.any():
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        assert polygon.min(axis=0) == pytest.approx([columns[0] + 0.25, rows[0] + 0.25])
        assert polygon.max(axis=0) == pytest.approx([columns[-1] + 0.75, rows[-1] + 0.75])


def test_seams_of_a_hole_cost_nothing_where_outlines_are_drawn() -> None:
    mask = ring()
    line = "0 " + " ".join(f"{value:.9g}" for value in (polygon_of(mask) / mask.shape[::-1]).ravel())
    assert np.array_equal(drawn(line, (mask.shape[0], mask.shape[1])), mask)


def test_an_empty_mask_has_no_corners() -> None:
    assert polygon_of(np.zeros((4, 5), bool)).shape == (0, 2)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("yaml", reason="no PyYAML")
    pytest.importorskip("pycocotools", reason="no pycocotools")
    folder = tmp_path_factory.mktemp("yolo")
    stage = write_room(folder)
    stage.write_text(stage.read_text().replace("\n            double size = 0.5", KEYPOINTS))
    settings = {**plain_config()["settings"], "resolution": [200, 150]}
    labels = {"classes": ["ball", "box"]}
    formats = ["yolo", "yolo-segment", "yolo-pose"]
    make(config_in(folder, labels=labels, settings=settings, write=formats), folder / "out")
    return folder / "out"


def lines_of(root: Path, sample: Sample) -> list[str]:
    return (root / f"labels/train/{sample.name}.txt").read_text().splitlines()


def visible(sample: Sample) -> list[tuple[dict[str, Any], Mask]]:
    found = [(thing, sample.mask(place)) for place, thing in enumerate(sample.things)]
    return [(thing, mask) for thing, mask in found if mask.any()]


def test_segments_are_the_masks(made: Path) -> None:
    counted = 0
    for sample in samples_of(made):
        width, height = sample.resolution
        for line, (thing, mask) in zip(lines_of(made / "yolo-segment", sample), visible(sample), strict=True):
            number, *values = line.split()
            assert int(number) == {"ball": 0, "box": 1}[thing["class"]]
            shares = np.array(values, float).reshape(-1, 2)
            assert len(shares) >= 4  # Ultralytics reads a line of up to 6 columns as a box
            assert shares.min() >= 0
            assert shares.max() <= 1
            assert np.array_equal(filled(shares * [width, height], (height, width)), mask)
            assert overlap(drawn(line, (height, width)), mask) >= 0.98
            counted += 1
    assert counted > 4


def test_lines_of_poses_have_the_box_and_a_triple_for_each_name(made: Path) -> None:
    import yaml

    says = yaml.safe_load((made / "yolo-pose/data.yaml").read_text())
    assert says["kpt_shape"] == [3, 3]
    assert says["kpt_names"][1] == ["left_top", "right_top", "front"]
    assert says["flip_idx"] == [1, 0, 2]
    seen = 0
    for sample in samples_of(made):
        boxes = lines_of(made / "yolo", sample)
        size = np.array(sample.resolution)
        for line, box, (thing, _) in zip(lines_of(made / "yolo-pose", sample), boxes, visible(sample), strict=True):
            assert line.startswith(box)
            triples = np.array(line.split()[5:], float).reshape(3, 3)
            for triple, point in zip(triples, thing["keypoints"] or [None] * 3, strict=True):
                if point is None or point["v"] == 0:
                    assert not triple.any()
                else:
                    assert triple[:2] * size == pytest.approx(point["pixel"], abs=1e-4)
                    assert triple[2] == point["v"]
                    seen += 1
    assert seen


def test_names_without_another_side_are_not_swapped() -> None:
    assert yolo_pose._of_names(["nose", "tail"], 1) == 'kpt_shape: [2, 3]\nkpt_names:\n  0:\n    - "nose"\n    - "tail"\n'
    assert "flip_idx" not in yolo_pose._of_names(["left_eye", "nose"], 1)
    assert "flip_idx: [2, 1, 0]" in yolo_pose._of_names(["eyeLeft", "nose", "eyeRight"], 2)
