"""BOP: masks and counts computed again from models and poses, as bop_toolkit's scripts calc_gt_info and calc_model_info do."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from primray.dataset import make
from primray.dataset.packing import read_integers
from primray.dataset.writers import bop_models

from .room import config_in, plain_config, write_room

WIDTH, HEIGHT = 64, 48
DELTA_MM = 5.0  # of photorealistic training pictures
SYMMETRIC = """
            matrix4d[] primray:symmetries = [((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, 0, 1))]
            double size = 0.5"""
ROUND = """
            vector3f[] primray:symmetries:axes = [(0, 2, 0)]
            double radius = 0.4"""
Floats = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("yaml", reason="no PyYAML")
    folder = tmp_path_factory.mktemp("bop")
    stage = write_room(folder)
    text = (
        stage.read_text()
        .replace("\n            double size = 0.5", SYMMETRIC)
        .replace("\n            double radius = 0.4", ROUND)
    )
    stage.write_text(text)
    settings = {**plain_config()["settings"], "resolution": [WIDTH, HEIGHT], "silhouettes": True}
    varied = plain_config()["vary"]
    varied["view"] |= {"distance": [2.5, 3.5], "field_of_view": 40}  # things are cut off, and hide each other
    varied["props"] |= {"gap": 0.0}
    make(
        config_in(folder, samples=4, labels={"classes": ["ball", "box"]}, settings=settings, vary=varied, write=["bop"]),
        folder / "out",
    )
    return folder / "out/bop"


def read_ply(path: Path) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """Positions, normals and triangles of an ascii PLY."""
    lines = path.read_text(encoding="ascii").splitlines()
    end = lines.index("end_header")
    assert lines[:2] == ["ply", "format ascii 1.0"]
    elements = {line.split()[1]: int(line.split()[2]) for line in lines[:end] if line.startswith("element")}
    assert [line.split()[-1] for line in lines[:end] if line.startswith("property float")] == ["x", "y", "z", "nx", "ny", "nz"]
    assert list(elements) == ["vertex", "face"]
    rows = np.array([line.split() for line in lines[end + 1 : end + 1 + elements["vertex"]]], float)
    faces = np.array([line.split() for line in lines[end + 1 + elements["vertex"] :]], np.int64)
    assert len(faces) == elements["face"]
    assert (faces[:, 0] == 3).all()
    return rows[:, :3], rows[:, 3:], faces[:, 1:]


def distances(
    points: Floats, triangles: npt.NDArray[np.int64], k: Floats, corner: tuple[int, int], size: tuple[int, int]
) -> Floats:
    """The distance in mm (H, W) of the nearest triangle along each pixel's ray, 0 for none; middles of pixels are integers."""
    width, height = size
    nearest = np.full((height, width), np.inf)
    film = points @ k.T
    for triangle in triangles:
        own, at = points[triangle], film[triangle]
        if at[:, 2].min() <= 1:
            continue
        x, y = at[:, 0] / at[:, 2] - corner[0], at[:, 1] / at[:, 2] - corner[1]
        x0, x1 = max(math.ceil(x.min()), 0), min(math.floor(x.max()), width - 1)
        y0, y1 = max(math.ceil(y.min()), 0), min(math.floor(y.max()), height - 1)
        if x0 > x1 or y0 > y1:
            continue
        grid = np.stack(np.meshgrid(np.arange(x0, x1 + 1), np.arange(y0, y1 + 1)), axis=-1).reshape(-1, 2)
        rays = np.column_stack([grid + corner, np.ones(len(grid))]) @ np.linalg.inv(k).T
        weights = rays @ np.linalg.inv(own)  # of the corners, up to a factor
        inside = (weights >= -1e-12).all(axis=1) & (weights.sum(axis=1) > 0)
        t = np.linalg.norm(rays, axis=1) / np.where(inside, weights.sum(axis=1), 1)
        own_x, own_y = grid[inside].T
        np.minimum.at(nearest, (own_y, own_x), t[inside])
    return np.where(np.isfinite(nearest), nearest, 0)


def box_of(mask: npt.NDArray[np.bool_], corner: tuple[int, int] = (0, 0)) -> list[int]:
    """misc.calc_2d_bbox: width is max - min."""
    y, x = np.nonzero(mask)
    return [int(x.min()) + corner[0], int(y.min()) + corner[1], int(np.ptp(x)), int(np.ptp(y))]


def say(root: Path, name: str) -> Any:
    return json.loads((root / "train_pbr/000000" / f"scene_{name}.json").read_text())


def test_masks_boxes_and_counts_are_those_of_the_models_in_their_poses(made: Path) -> None:
    scene = made / "train_pbr/000000"
    cameras, poses, infos = say(made, "camera"), say(made, "gt"), say(made, "gt_info")
    models = {int(path.stem.removeprefix("obj_")): read_ply(path) for path in (made / "models").glob("obj_*.ply")}
    truncated = hidden = 0
    for key, of_image in poses.items():
        k = np.array(cameras[key]["cam_K"]).reshape(3, 3)
        stored = read_integers(scene / f"depth/{int(key):06d}.png")[..., 0]
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(k).T
        seen = stored * cameras[key]["depth_scale"] * np.linalg.norm(rays, axis=-1)
        assert len(infos[key]) == len(of_image)
        for number, (pose, info) in enumerate(zip(of_image, infos[key], strict=True)):
            points, _, triangles = models[pose["obj_id"]]
            rotation = np.array(pose["cam_R_m2c"]).reshape(3, 3)
            placed = points @ rotation.T + pose["cam_t_m2c"]
            large = distances(placed, triangles, k, (-WIDTH, -HEIGHT), (3 * WIDTH, 3 * HEIGHT))
            own = large[HEIGHT : 2 * HEIGHT, WIDTH : 2 * WIDTH]
            whole, visible = own > 0, (own > 0) & (seen > 0) & (own - seen <= DELTA_MM)
            name = f"{int(key):06d}_{number:06d}.png"
            mask, mask_visib = (read_integers(scene / kind / name)[..., 0] for kind in ("mask", "mask_visib"))
            for stored_mask, computed in ((mask, whole), (mask_visib, visible)):
                assert set(np.unique(stored_mask)) <= {0, 255}
                # The balls of models are flat between their points, by 0.1 % of the radius.
                assert ((stored_mask > 0) != computed).sum() <= 0.04 * max(whole.sum(), 50)
            few = 0.02 * max((large > 0).sum(), 50)
            assert info["px_count_all"] == pytest.approx((large > 0).sum(), abs=few)
            assert info["px_count_valid"] == int(((mask > 0) & (stored > 0)).sum())
            assert info["px_count_visib"] == int((mask_visib > 0).sum())
            assert info["visib_fract"] == pytest.approx(info["px_count_visib"] / max(info["px_count_all"], 1))
            if not info["px_count_visib"]:
                assert info["bbox_obj"] == info["bbox_visib"] == [-1, -1, -1, -1]
                continue
            assert info["bbox_visib"] == box_of(mask_visib > 0)
            assert info["bbox_obj"] == pytest.approx(box_of(large > 0, (-WIDTH, -HEIGHT)), abs=1)
            truncated += info["px_count_all"] > info["px_count_valid"]
            hidden += info["px_count_valid"] > info["px_count_visib"]
    assert truncated
    assert hidden


def test_models_infos_are_those_of_the_files(made: Path) -> None:
    infos = json.loads((made / "models/models_info.json").read_text())
    assert sorted(infos) == ["1", "2", "3"]  # the ball, a cube, and the cuboid as a further model
    for key, info in infos.items():
        points, normals, triangles = read_ply(made / f"models/obj_{int(key):06d}.ply")
        low, high = points.min(axis=0), points.max(axis=0)
        assert [info[f"min_{axis}"] for axis in "xyz"] == pytest.approx(low.tolist(), abs=1e-3)
        assert [info[f"size_{axis}"] for axis in "xyz"] == pytest.approx((high - low).tolist(), abs=1e-3)
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)
        assert info["diameter"] == pytest.approx(apart.max(), abs=1e-3)
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1, abs=1e-5)
        across = np.cross(points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]])
        assert ((across * points[triangles].mean(axis=1)).sum(axis=1) > 0).all()  # outwards: the shapes hold their origins
    assert [infos["1"][f"size_{axis}"] for axis in "xyz"] == pytest.approx([800, 800, 800], rel=1e-4)
    cuboid = next(info for info in infos.values() if info["size_y"] == pytest.approx(900, rel=1e-4))
    assert cuboid["size_x"] == pytest.approx(300, rel=1e-4)


def test_authored_symmetries_are_in_mm_and_row_by_row(made: Path) -> None:
    infos = json.loads((made / "models/models_info.json").read_text())
    (axis,) = infos["1"]["symmetries_continuous"]
    assert axis == {"axis": [0, 1, 0], "offset": [0, 0, 0]}
    cube = next(info for info in infos.values() if info["size_y"] == pytest.approx(500, rel=1e-4))
    assert cube["symmetries_discrete"] == [[-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]]


def shape(symmetries: Any = (), axes: Any = ()) -> Any:
    from primray.labels.shapes import ThingShape

    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return ThingShape(
        points, np.array([[0, 1, 2]]), np.array(symmetries, float).reshape(-1, 4, 4), np.array(axes, float).reshape(-1, 2, 3)
    )


def test_symmetries_that_a_scale_ends_are_left_out() -> None:
    quarter = [[0, 0, 1, 0.5], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]
    half = np.diag([-1, 1, -1, 1])
    about_y, about_x = [[0.5, 0, 0], [0, 3, 0]], [[0, 0, 0], [1, 0, 0]]
    stretched = bop_models.scaled(shape([quarter, half], [about_y, about_x]), np.array([100.0, 200.0, 100.0]))
    assert len(stretched.symmetries) == 2
    assert stretched.symmetries[0][0, 3] == 50
    assert stretched.axes.tolist() == [[[50, 0, 0], [0, 1, 0]]]
    flat = bop_models.scaled(shape([quarter, half], [about_y, about_x]), np.array([100.0, 100.0, 300.0]))
    assert len(flat.symmetries) == 1
    assert not len(flat.axes)


def test_the_diameter_is_that_of_all_pairs() -> None:
    chance = np.random.default_rng(2)
    for _ in range(20):
        points = chance.normal(size=(60, 3)) * chance.uniform(0.1, 9, 3)
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)
        assert bop_models.diameter_of(points) == pytest.approx(apart.max())


def test_without_silhouettes_mask_is_left_out_and_reported(tmp_path: Path) -> None:
    found = make(config_in(tmp_path, labels={}, samples=1, write=["bop"]), tmp_path / "out")
    assert found.notes == ("bop: mask is left out: it needs settings: {silhouettes: true}",)
    assert not (tmp_path / "out/bop/train_pbr/000000/mask").exists()
    (info, *_) = say(tmp_path / "out/bop", "gt_info")["0"]
    assert set(info) == {"bbox_obj", "bbox_visib", "px_count_all", "px_count_valid", "px_count_visib", "visib_fract"}


def test_a_thing_that_changes_its_size_is_several_models_or_has_none(tmp_path: Path) -> None:
    sizes = {"attribute": "/World/props/b.radius", "to": {"in_order": [0.2, 0.4]}}
    found = make(config_in(tmp_path, labels={}, samples=4, vary={"size": sizes}, write=["bop"]), tmp_path / "two")
    poses = say(tmp_path / "two/bop", "gt")
    per_sample = [[pose["obj_id"] for pose in poses[str(k)]] for k in range(4)]
    assert per_sample == [[2, 1, 3], [2, 4, 3]] * 2
    sizes["to"] = {"uniform": [0.1, 0.4]}
    found = make(config_in(tmp_path, labels={}, samples=12, vary={"size": sizes}, write=["bop"]), tmp_path / "many")
    assert any("12 things are left out: they have more than 8 shapes" in note for note in found.notes)
    assert [pose["obj_id"] for pose in say(tmp_path / "many/bop", "gt")["0"]] == [2, 3]
    assert sorted(json.loads((tmp_path / "many/bop/models/models_info.json").read_text())) == ["2", "3"]


def test_the_silhouette_is_what_a_render_of_the_thing_alone_shows(tmp_path: Path) -> None:
    """Masks of the whole picture are compared with those of pictures in which nothing else is there."""
    import primray

    stage = write_room(tmp_path)
    view = primray.Camera.from_field_of_view(
        50, (WIDTH, HEIGHT), np.array([[1, 0, 0, 0], [0, 1, 0, 0.1], [0, 0, 1, 2], [0, 0, 0, 1]], float)
    )
    aovs = ["object_instance:class"]
    scene = primray.Scene(str(stage))
    things = scene.first_hits(camera=view, resolution=(WIDTH, HEIGHT), aovs=aovs, silhouettes=True).things
    assert len(things) == 3
    assert any(thing.silhouette is not None and thing.pixels_visible < thing.silhouette.mask.sum() for thing in things)
    for thing in things:
        alone = primray.Scene(str(stage), mask=[thing.path])
        seen = alone.first_hits(camera=view, resolution=(WIDTH, HEIGHT), aovs=aovs)
        assert thing.silhouette is not None
        assert np.array_equal(thing.silhouette.mask, seen.mask_of(seen.things[0]))
        assert thing.pixels_in_frame == thing.silhouette.mask.sum()
