"""Semantic labels of what each pixel sees first, as ids with a table, and bounding boxes of labelled objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .. import core
from ..aov_names import AovRequest, taxonomy_of
from ..description import Camera
from ..settings import RenderSettings
from .aov import Aov, channel_names
from .files.exr_header import exr_matrices
from .first_hit import Ids

# labels(prim, instance, taxonomy): labels of a prim in an instance, including inherited ones.
LabelsOf = Callable[[str, str, str], tuple[str, ...]]


def labels_of_view(
    scene: core.CoreScene, requests: Sequence[AovRequest], camera: Camera, settings: RenderSettings, labels: LabelsOf
) -> tuple[dict[str, Aov], dict[str, Any]]:
    """Return label AOVs by name, and the report's entries: the camera's matrices, and the boxes of labelled objects."""
    assert scene.record is not None
    found = core.first_hits(scene, ["prim", "instance"], [], settings)
    ids = Ids(scene, scene.record, {})  # by path, the key of labels
    prims, instances = ids.prim(found), ids.instance(found)
    both = np.stack([prims[0][..., 0].astype(np.int64), instances[0][..., 0].astype(np.int64)], axis=2)
    things, thing = np.unique(both.reshape(-1, 2), axis=0, return_inverse=True)
    names = [(prims[1].get(prim, ""), instances[1].get(instance, "")) for prim, instance in things.tolist()]
    thing = thing.reshape(both.shape[:2])
    world, ndc = exr_matrices(camera)
    says: dict[str, Any] = {
        "camera": {
            "path": camera.path,
            "world_from_camera": camera.world_from_camera.tolist(),
            "world_to_camera": world.tolist(),
            "world_to_ndc": ndc.tolist() if camera.distortion is None else None,
        },
        "boxes": {},
    }
    made = {}
    for request in requests:
        texts = [",".join(labels(prim, instance, str(taxonomy_of(request.source)))) for prim, instance in names]
        numbers = {text: number for number, text in enumerate(sorted({text for text in texts if text}), start=1)}
        values = np.array([numbers.get(text, 0) for text in texts], np.uint32)[thing][..., None]
        table = {number: text for text, number in numbers.items()}
        made[request.name] = Aov(
            values,
            channel_names(request.name if request.prefix is None else request.prefix, ("",), request.name),
            request.source,
            f"labels of {taxonomy_of(request.source)}",
            "uint",
            table,
        )
        says["boxes"][request.name] = _boxes(thing, names, texts)
    return made, says


def _boxes(thing: Any, names: Sequence[tuple[str, str]], texts: Sequence[str]) -> list[dict[str, Any]]:
    """Return the box of every labelled instance or prim as x0, y0, x1, y1 in pixels, ends excluded; larger objects first."""
    groups: dict[tuple[str, str], list[int]] = {}
    for number, ((prim, instance), text) in enumerate(zip(names, texts, strict=True)):
        if text:
            groups.setdefault((text, instance or prim), []).append(number)
    rows = []
    for (text, name), members in groups.items():
        there = np.isin(thing, members)
        y, x = np.flatnonzero(there.any(axis=1)), np.flatnonzero(there.any(axis=0))
        box = [int(x[0]), int(y[0]), int(x[-1]) + 1, int(y[-1]) + 1]
        rows.append({"label": text, "object": name, "box": box, "pixels": int(there.sum())})
    return sorted(rows, key=lambda row: -row["pixels"])
