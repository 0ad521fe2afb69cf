"""BOP: train_pbr/000000/{rgb,depth,mask_visib}, scene_camera.json, scene_gt.json, scene_gt_info.json, and camera.json.

A thing's obj_id is the id of its class: things of one class are taken to be one model. Poses are cam_R_m2c (row-wise) and
cam_t_m2c (mm) from the prim's own space, in OpenCV's axes; a prim's scale belongs into the model, as R has no place for it.
Depth is 16 bits along Z, times depth_scale in mm. Boxes are those of bop_toolkit: width is max - min, so that one pixel has 0,
and -1 -1 -1 -1 where nothing is seen. (bop_toolkit, docs/bop_datasets_format.md)
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..packing import Sample, link
from .coco import box_of

if TYPE_CHECKING:
    from ...arrays import Doubles
    from ..config import Config
    from ..document import Entry
    from ..lock_file import Lock

NEEDS_LABELS, PICTURES, AOVS = True, ("png", "npy"), ("depth",)
SCENE = "train_pbr/000000"
FINEST_MM = 0.1  # the usual depth_scale; farther pictures have a coarser one
NOWHERE = [-1, -1, -1, -1]
SHEARED = 1e-4


def options(entry: Entry | None) -> dict[str, Any]:
    if entry is not None:
        entry.fields()
    return {}


def write(samples: Iterable[Sample], config: Config, lock: Lock, asked: Any, folder: Path) -> list[str]:
    from ...images.image import write_png

    scene = folder / SCENE
    for name in ("depth", "mask_visib"):
        (scene / name).mkdir(parents=True)
    cameras, poses, infos = dict[str, Any](), dict[str, list[Any]](), dict[str, list[Any]]()
    left_out = {"without a 3-D box": 0, "sheared": 0}
    first: dict[str, Any] | None = None
    for sample in samples:
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
            pose = pose_of(thing, sample)
            if isinstance(pose, str):
                left_out[pose] += 1
                continue
            mask = sample.mask(place)
            name = f"{sample.name}_{len(poses[key]):06d}.png"
            write_png((mask * np.uint8(255))[..., None], scene / "mask_visib" / name)
            poses[key].append(pose)
            infos[key].append(info_of(thing, mask))
    for name, says in (("scene_camera", cameras), ("scene_gt", poses), ("scene_gt_info", infos)):
        (scene / f"{name}.json").write_text(json.dumps(says) + "\n", encoding="utf-8")
    (folder / "camera.json").write_text(json.dumps(first or {}) + "\n", encoding="utf-8")
    return [f"{count} things are left out: {why}" for why, count in left_out.items() if count]


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


def pose_of(thing: dict[str, Any], sample: Sample) -> dict[str, Any] | str:
    """Return the entry of scene_gt.json; or why a thing has none."""
    if thing["box_3d"] is None:
        return "without a 3-D box"
    world = np.array(thing["box_3d"]["world_from_prim"])
    pose = np.array(sample.record["camera"]["opencv_camera_from_world"]) @ world
    rotation = rotation_of(pose[:3, :3])
    if rotation is None:
        return "sheared"
    return {
        "cam_R_m2c": rotation.ravel().tolist(),
        "cam_t_m2c": (pose[:3, 3] * metres_per_unit(sample) * 1000).tolist(),
        "obj_id": thing["class_id"],
    }


def rotation_of(linear: Doubles) -> Doubles | None:
    """Return the rotation of a linear map that turns and scales along its own axes; None for any other, mirrors included."""
    sizes = np.linalg.norm(linear, axis=0)
    if not sizes.min() > 0:
        return None
    rotation: Doubles = linear / sizes
    is_one = np.abs(rotation.T @ rotation - np.eye(3)).max() < SHEARED and np.linalg.det(rotation) > 0
    return rotation if is_one else None


def info_of(thing: dict[str, Any], mask: np.ndarray[Any, Any]) -> dict[str, Any]:
    """Return the entry of scene_gt_info.json, with what the record has; px_count_valid is that of all."""
    seen, every = int(mask.sum()), thing["pixels_all"]
    x, y, w, h = box_of(mask) if seen else NOWHERE
    whole = thing["box_all"]
    said: dict[str, Any] = {
        "bbox_obj": NOWHERE if whole is None else whole_pixels(whole),
        "bbox_visib": [x, y, w - 1, h - 1] if seen else NOWHERE,
        "px_count_visib": seen,
    }
    if every is not None:
        said |= {"px_count_all": every, "px_count_valid": every, "visib_fract": seen / every if every else 0.0}
    return said


def whole_pixels(box: Sequence[float]) -> list[int]:
    """Return x, y, width and height, as BOP counts them, of the pixels that a box x0, y0, x1, y1 touches."""
    x0, y0 = math.floor(box[0]), math.floor(box[1])
    return [x0, y0, math.ceil(box[2]) - 1 - x0, math.ceil(box[3]) - 1 - y0]
