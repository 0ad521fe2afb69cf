"""AOVs of labels and of labelled things, and what the report says of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..aovs import LABELS, THINGS, AovRequest, shows_things, taxonomy_of
from ..camera import Projection
from ..images.aov import Aov, channel_names
from ..images.first_hit import Ids
from ..images.writers import exr_matrices
from ..lens.distortion import distortion_as_json
from .table import LabelTable, extended_table
from .things import Box, Hierarchy, Thing, ids_of_paths

if TYPE_CHECKING:
    from ..diagnostics import Diagnostics
    from ..report.prepared import Prepared

Numbers = npt.NDArray[np.integer[Any]]


@dataclass(frozen=True)
class Seen:
    """What each pixel shows, as an index (H, W) into (prim, instance) names; "" for none."""

    index: Numbers
    names: Sequence[tuple[str, str]]


def labels_of_view(
    prepared: Prepared, requests: Sequence[AovRequest], diagnostics: Diagnostics
) -> tuple[dict[str, Aov], dict[str, Any]]:
    """Return AOVs by name, and the report's entries: the camera's matrices, boxes of labelled objects, and things."""
    seen = _seen_of(prepared)
    says: dict[str, Any] = {"camera": _camera_facts(prepared), "boxes": {}}
    made: dict[str, Aov] = {}
    taxonomies = dict.fromkeys(str(taxonomy_of(r.source)) for r in requests if shows_things(r.source))
    of_things = {taxonomy: _ThingsSeen(prepared, seen, taxonomy, diagnostics) for taxonomy in taxonomies}
    for request in requests:
        taxonomy = str(taxonomy_of(request.source))
        if request.source.startswith(LABELS):
            made[request.name], texts = _inherited_labels(prepared, seen, request)
            says["boxes"][request.name] = _boxes(seen, texts)
        elif request.source.startswith(THINGS):
            made[request.name] = of_things[taxonomy].things_aov(request)
        else:
            made[request.name] = of_things[taxonomy].classes_aov(request)
    with_ids = dict.fromkeys(str(taxonomy_of(r.source)) for r in requests if r.source.startswith(THINGS))
    if with_ids:
        says["things"] = [thing.as_json() for taxonomy in with_ids for thing in of_things[taxonomy].things()]
    return made, says


def _seen_of(prepared: Prepared) -> Seen:
    scene = prepared.scene
    assert scene.record is not None
    found = core.first_hits(scene, ["prim", "instance", "outer"], [], prepared.settings).planes
    ids = Ids(scene, scene.record, {})  # by path, the key of labels
    prims, instances = ids.prim(found), ids.instance(found)
    both = np.stack([prims[0][..., 0].astype(np.int64), instances[0][..., 0].astype(np.int64)], axis=2)
    different, index = np.unique(both.reshape(-1, 2), axis=0, return_inverse=True)
    names = [(prims[1].get(prim, ""), instances[1].get(instance, "")) for prim, instance in different.tolist()]
    return Seen(index.reshape(both.shape[:2]), names)


def _camera_facts(prepared: Prepared) -> dict[str, Any]:
    camera = prepared.camera
    world, ndc = exr_matrices(camera)
    is_perspective = camera.projection is Projection.PERSPECTIVE
    return {
        "path": camera.path,
        "world_from_camera": camera.world_from_camera.tolist(),
        "world_to_camera": world.tolist(),
        "world_to_ndc": ndc.tolist() if camera.distortion is None else None,
        "intrinsics": camera.intrinsics(prepared.scene.resolution).tolist() if is_perspective else None,
        "distortion": distortion_as_json(camera.distortion),
        "opencv_camera_from_world": camera.opencv_camera_from_world.tolist(),
        "opengl_camera_from_world": camera.opengl_camera_from_world.tolist(),
        "opengl_projection": camera.opengl_projection.tolist() if camera.distortion is None else None,
    }


def _inherited_labels(prepared: Prepared, seen: Seen, request: AovRequest) -> tuple[Aov, list[str]]:
    """Return the AOV of a taxonomy's labels, and the labels of what is seen."""
    assert prepared.labelled is not None
    taxonomy = str(taxonomy_of(request.source))
    texts = [",".join(prepared.labelled.inherited(prim, instance, taxonomy)) for prim, instance in seen.names]
    numbers = {text: number for number, text in enumerate(sorted({text for text in texts if text}), start=1)}
    values = np.array([numbers.get(text, 0) for text in texts], np.uint32)[seen.index]
    return _ids_aov(request, values, {number: text for text, number in numbers.items()}, f"labels of {taxonomy}"), texts


def _ids_aov(request: AovRequest, values: npt.NDArray[np.uint32], ids: Mapping[int, str], meaning: str) -> Aov:
    name = request.name if request.prefix is None else request.prefix
    return Aov(
        values=values[..., None],
        channels=channel_names(name, ("",), request.name),
        source=request.source,
        meaning=meaning,
        stored="uint",
        ids=ids,
    )


def _boxes(seen: Seen, texts: Sequence[str]) -> list[dict[str, Any]]:
    """Return the box of every labelled instance or prim as x0, y0, x1, y1 in pixels, ends excluded; larger objects first."""
    groups: dict[tuple[str, str], list[int]] = {}
    for number, ((prim, instance), text) in enumerate(zip(seen.names, texts, strict=True)):
        if text:
            groups.setdefault((text, instance or prim), []).append(number)
    rows = []
    for (text, name), members in groups.items():
        there = np.isin(seen.index, members)
        y, x = np.flatnonzero(there.any(axis=1)), np.flatnonzero(there.any(axis=0))
        box = [int(x[0]), int(y[0]), int(x[-1]) + 1, int(y[-1]) + 1]
        rows.append({"label": text, "object": name, "box": box, "pixels": int(there.sum())})
    return sorted(rows, key=lambda row: -row["pixels"])


class _ThingsSeen:
    """The things of one taxonomy in a picture."""

    def __init__(self, prepared: Prepared, seen: Seen, taxonomy: str, diagnostics: Diagnostics) -> None:
        assert prepared.labelled is not None
        self._prepared, self._taxonomy = prepared, taxonomy
        labelled = prepared.labelled
        self._hierarchy = Hierarchy(taxonomy)
        places = [self._hierarchy.innermost(labelled.holding(prim, instance, taxonomy)) for prim, instance in seen.names]
        self._places = np.array(places, np.int64)[seen.index]  # (H, W); -1: none
        self._classes: Mapping[str, int] = (prepared.label_table or LabelTable()).classes.get(taxonomy, {})
        self._ids = self._with_ids(diagnostics)

    def _with_ids(self, diagnostics: Diagnostics) -> dict[str, int]:
        """Return the ids of the things by path; clashes are reported, and kept in the label table."""
        hierarchy, settings = self._hierarchy, self._prepared.settings
        fixed = (self._prepared.label_table or LabelTable()).instances.get(self._taxonomy, {})
        ids, clashes = ids_of_paths(hierarchy.names, fixed)
        if clashes and settings.label_table is not None:

            def extend(table: LabelTable) -> LabelTable:
                found, own = ids_of_paths(hierarchy.names, table.instances.get(self._taxonomy, {}))
                return table.with_instances(self._taxonomy, {path: found[path] for path in own})

            table, _ = extended_table(settings, extend)
            ids, _ = ids_of_paths(hierarchy.names, table.instances.get(self._taxonomy, {}))
        for path, other in clashes.items():
            message = f"Its id by its path is that of {other}: it has {ids[path]}."
            diagnostics.add("label-clash", path, message)
        return ids

    def classes_aov(self, request: AovRequest) -> Aov:
        numbers = np.array([*map(self._class_id, self._hierarchy.classes), 0], np.uint32)
        names = {number: name for name, number in sorted(self._classes.items(), key=lambda item: item[1])}
        return _ids_aov(request, numbers[self._places], names, f"class of {self._taxonomy}")

    def things_aov(self, request: AovRequest) -> Aov:
        numbers = np.array([*(self._ids[name] for name in self._hierarchy.names), 0], np.uint32)
        names = {self._ids[name]: name for name in sorted(self._hierarchy.names)}
        return _ids_aov(request, numbers[self._places], names, f"labelled prim of {self._taxonomy}")

    def _class_id(self, name: str) -> int:
        return self._classes[name]

    def things(self) -> list[Thing]:
        """Return the things in the picture, in the order of their paths; a thing has the pixels of those that it holds."""
        hierarchy = self._hierarchy
        visible = _pixels_of(self._places, hierarchy)
        return [
            Thing(
                id=self._ids[hierarchy.names[n]],
                path=hierarchy.names[n],
                taxonomy=self._taxonomy,
                class_name=hierarchy.classes[n],
                class_id=self._class_id(hierarchy.classes[n]),
                parent=None if hierarchy.parents[n] < 0 else self._ids[hierarchy.names[hierarchy.parents[n]]],
                pixels_visible=visible[n][0],
                box_tight=visible[n][1],
            )
            for n in sorted(range(len(hierarchy.names)), key=lambda n: hierarchy.names[n])
        ]


def _pixels_of(places: Numbers, hierarchy: Hierarchy) -> list[tuple[int, Box | None]]:
    """Return the number of pixels and the box of each thing, with the things that it holds."""
    height, width = places.shape
    low = np.full((len(hierarchy.names), 2), max(height, width), np.int64)
    high, count = np.zeros((len(hierarchy.names), 2), np.int64), np.zeros(len(hierarchy.names), np.int64)
    y, x = np.nonzero(places >= 0)
    own = places[y, x]
    for axis, at in enumerate((x, y)):
        np.minimum.at(low[:, axis], own, at)
        np.maximum.at(high[:, axis], own, at + 1)
    np.add.at(count, own, 1)
    for n in reversed(range(len(hierarchy.names))):  # what a thing holds is after it
        parent = hierarchy.parents[n]
        if parent >= 0:
            low[parent], high[parent] = np.minimum(low[parent], low[n]), np.maximum(high[parent], high[n])
            count[parent] += count[n]
    boxes = np.concatenate([low, high], axis=1).tolist()
    return [(total, tuple(box) if total else None) for total, box in zip(count.tolist(), boxes, strict=True)]
