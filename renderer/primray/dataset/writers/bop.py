"""BOP: train_pbr/000000/{rgb,depth,mask,mask_visib}, scene_camera.json, scene_gt.json, scene_gt_info.json, models, camera.json.

Poses are cam_R_m2c (row-wise) and cam_t_m2c (mm) from the prim's own space, in OpenCV's axes; a prim's scale is in its model
(bop_models.py), as R has no place for it. Depth is 16 bits along Z, times depth_scale in mm. Boxes are those of bop_toolkit:
width is max - min, so that one pixel has 0, and -1 -1 -1 -1 where nothing is seen. `mask`, the boxes of silhouettes and exact
counts of valid pixels need the setting `silhouettes`. (bop_toolkit, its calc_gt_info and docs/bop_datasets_format.md)
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...images.image import write_png
from ...labels.things import Silhouette
from ..packing import Sample, check_pinhole, link
from .bop_models import MOST_SHAPES, Models, learnt
from .coco import box_of, classes_of

if TYPE_CHECKING:
    from ...arrays import Doubles
    from ..config import Config
    from ..document import Entry
    from ..lock_file import Lock

NEEDS_LABELS, NEEDS_PINHOLE, PICTURES, AOVS = True, True, ("png", "npy"), ("depth",)
SCENE = "train_pbr/000000"
FINEST_MM = 0.1  # the usual depth_scale; farther pictures have a coarser one
NOWHERE = [-1, -1, -1, -1]
SHEARED = 1e-4


def options(entry: Entry | None) -> dict[str, Any]:
    if entry is not None:
        entry.fields()
    return {}


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    scene = folder / SCENE
    has_silhouettes = bool(config.settings.get("silhouettes"))
    for name in ("depth", "mask_visib", *(("mask",) if has_silhouettes else ())):
        (scene / name).mkdir(parents=True)
    cameras, poses, infos = dict[str, Any](), dict[str, list[Any]](), dict[str, list[Any]]()
    left_out: Counter[str] = Counter()
    models = learnt(samples, config, lock, max((int(number) for _, number in classes_of(lock, config)), default=0))
    first: dict[str, Any] | None = None
    for sample in samples:
        check_pinhole("BOP", sample)
        key = str(sample.index)
        link(sample.file("picture"), scene / "rgb" / f"{sample.name}.png")
        depth, scale = depth_image(sample)
        write_png(depth[..., None], scene / "depth" / f"{sample.name}.png")
        cameras[key] = camera_of(sample, scale)
        first = first or {
            **_intrinsics(sample),
            "width": sample.resolution[0],
            "height": sample.resolution[1],
            "depth_scale": scale,
        }
        poses[key], infos[key] = [], []
        for place, thing in enumerate(sample.things):
            pose = pose_of(thing, sample, models)
            if isinstance(pose, str):
                left_out[pose] += 1
                continue
            visible = sample.mask(place)
            whole = silhouette_of(thing, visible) if has_silhouettes else None
            name = f"{sample.name}_{len(poses[key]):06d}.png"
            _write_mask(visible, scene / "mask_visib" / name)
            if whole is not None:
                _write_mask(whole, scene / "mask" / name)
            poses[key].append(pose)
            infos[key].append(info_of(thing, visible, None if whole is None else int((whole & (depth > 0)).sum())))
    for name, says in (("scene_camera", cameras), ("scene_gt", poses), ("scene_gt_info", infos)):
        (scene / f"{name}.json").write_text(json.dumps(says) + "\n", encoding="utf-8")
    (folder / "camera.json").write_text(json.dumps(first or {}) + "\n", encoding="utf-8")
    models.write(folder / "models", (pose["obj_id"] for of_image in poses.values() for pose in of_image))
    notes = [f"{count} things are left out: {why}" for why, count in sorted(left_out.items())]
    return notes + ([] if has_silhouettes else ["mask is left out: it needs settings: {silhouettes: true}"])


def _write_mask(mask: np.ndarray[Any, Any], path: Path) -> None:
    write_png((mask * np.uint8(255))[..., None], path)


def silhouette_of(thing: dict[str, Any], visible: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the pixels (H, W) of a thing, whatever hides it."""
    said = thing.get("silhouette")
    return np.zeros_like(visible) if said is None else Silhouette(**said).mask


def metres_per_unit(sample: Sample) -> float:
    return float(sample.record["meters_per_unit"])


def depth_image(sample: Sample) -> tuple[np.ndarray[Any, Any], float]:
    """Return depths along Z as 16-bit numbers (0: nothing), and the millimetres of one."""
    depth = sample.aov("depth")[..., 0].astype(np.float64) * metres_per_unit(sample) * 1000
    there = np.isfinite(depth) & (depth > 0) & (depth < 1e9)
    farthest = float(depth[there].max()) if there.any() else 0.0
    scale = FINEST_MM
    while farthest / scale > 65535:
        scale *= 2
    return np.where(there, np.rint(np.where(there, depth, 0) / scale), 0).astype(np.uint16), scale


def camera_of(sample: Sample, depth_scale: float) -> dict[str, Any]:
    pose = np.array(sample.record["camera"]["opencv_camera_from_world"])
    k = sample.record["camera"]["intrinsics"]
    return {
        "cam_K": [value for row in k for value in row],
        "depth_scale": depth_scale,
        "cam_R_w2c": pose[:3, :3].ravel().tolist(),
        "cam_t_w2c": (pose[:3, 3] * metres_per_unit(sample) * 1000).tolist(),
    }


def _intrinsics(sample: Sample) -> dict[str, float]:
    k = sample.record["camera"]["intrinsics"]
    return {"fx": k[0][0], "fy": k[1][1], "cx": k[0][2], "cy": k[1][2]}


def pose_of(thing: dict[str, Any], sample: Sample, models: Models) -> dict[str, Any] | str:
    """Return the entry of scene_gt.json; or why a thing has none."""
    if thing["box_3d"] is None:
        return "without a 3-D box"
    world = np.array(thing["box_3d"]["world_from_prim"])
    pose = np.array(sample.record["camera"]["opencv_camera_from_world"]) @ world
    rotation = rotation_of(pose[:3, :3])
    if rotation is None:
        return "sheared"
    model = models.of(thing, sample)
    if model is None:
        return f"they have more than {MOST_SHAPES} shapes, or no surface"
    return {
        "cam_R_m2c": rotation.ravel().tolist(),
        "cam_t_m2c": (pose[:3, 3] * metres_per_unit(sample) * 1000).tolist(),
        "obj_id": model,
    }


def rotation_of(linear: Doubles) -> Doubles | None:
    """Return the rotation of a linear map that turns and scales along its own axes; None for any other, mirrors included."""
    sizes = np.linalg.norm(linear, axis=0)
    if not sizes.min() > 0:
        return None
    rotation: Doubles = linear / sizes
    is_one = np.abs(rotation.T @ rotation - np.eye(3)).max() < SHEARED and np.linalg.det(rotation) > 0
    return rotation if is_one else None


def info_of(thing: dict[str, Any], visible: np.ndarray[Any, Any], valid: int | None) -> dict[str, Any]:
    """Return the entry of scene_gt_info.json; `valid`: pixels of the silhouette with a depth, or None for all in the frame."""
    seen, every = int(visible.sum()), thing["pixels_all"]
    x, y, w, h = box_of(visible) if seen else NOWHERE
    return {
        "bbox_obj": whole_box(thing) if seen else NOWHERE,
        "bbox_visib": [x, y, w - 1, h - 1] if seen else NOWHERE,
        "px_count_all": every,
        "px_count_valid": thing["pixels_in_frame"] if valid is None else valid,
        "px_count_visib": seen,
        "visib_fract": seen / every if every else 0.0,
    }


def whole_box(thing: dict[str, Any]) -> list[int]:
    """Return the box of a silhouette, whatever hides it or is beside the frame."""
    if thing.get("silhouette") is not None:
        x0, y0, x1, y1 = thing["silhouette"]["box"]
        return [x0, y0, x1 - 1 - x0, y1 - 1 - y0]
    return NOWHERE if thing["box_all"] is None else whole_pixels(thing["box_all"])


def whole_pixels(box: Sequence[float]) -> list[int]:
    """Return x, y, width and height, as BOP counts them, of the pixels that a box x0, y0, x1, y1 touches."""
    x0, y0 = math.floor(box[0]), math.floor(box[1])
    return [x0, y0, math.ceil(box[2]) - 1 - x0, math.ceil(box[3]) - 1 - y0]
