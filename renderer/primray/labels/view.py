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
from ..images.writers import exr_matrices
from ..lens.distortion import distortion_as_json
from .layers import Numbers, PartNames, TaxonomyThings
from .survey import PLANES, Survey, first_parts
from .table import LabelTable, extended_table
from .things import Box, Hierarchy, Thing, ids_of_paths

if TYPE_CHECKING:
    from ..diagnostics import Diagnostics
    from ..report.prepared import Prepared


@dataclass(frozen=True)
class Seen:
    """What each pixel shows: `index` (H, W) of its part, -1 for none, and its `depth` (H, W), if that is needed."""

    index: Numbers
    parts: PartNames
    depth: npt.NDArray[np.floating[Any]]


def labels_of_view(
    prepared: Prepared,
    requests: Sequence[AovRequest],
    diagnostics: Diagnostics,
    planes: Mapping[str, npt.NDArray[Any]] | None = None,
) -> tuple[dict[str, Aov], dict[str, Any]]:
    """Return AOVs by name, and the report's entries: the camera's matrices, boxes of labelled objects, and things.

    `planes`: those of `planes_of_labels`, if other AOVs have them.
    """
    parts = PartNames(prepared.scene)
    survey = Survey(prepared, parts, planes) if _measures(requests) else None
    seen = _seen_of(prepared, parts) if survey is None else _seen_by(survey, parts)
    says: dict[str, Any] = {"camera": _camera_facts(prepared), "boxes": {}}
    made: dict[str, Aov] = {}
    taxonomies = dict.fromkeys(str(taxonomy_of(r.source)) for r in requests if shows_things(r.source))
    of_things = {taxonomy: _ThingsSeen(prepared, seen, taxonomy) for taxonomy in taxonomies}
    with_ids = dict.fromkeys(str(taxonomy_of(r.source)) for r in requests if r.source.startswith(THINGS))
    if survey is not None:
        survey.find_parts([of_things[taxonomy].things for taxonomy in with_ids])
    for taxonomy in with_ids:
        of_things[taxonomy].give_ids(diagnostics)
    for request in requests:
        taxonomy = str(taxonomy_of(request.source))
        if request.source.startswith(LABELS):
            made[request.name], texts = _inherited_labels(prepared, seen, request)
            says["boxes"][request.name] = _boxes(seen, texts)
        elif request.source.startswith(THINGS):
            made[request.name] = of_things[taxonomy].things_aov(request)
        else:
            made[request.name] = of_things[taxonomy].classes_aov(request)
    if survey is not None:
        says["things"] = [thing.as_json() for taxonomy in with_ids for thing in of_things[taxonomy].measured(seen, survey)]
    return made, says


def _measures(requests: Sequence[AovRequest]) -> bool:
    return any(r.source.startswith(THINGS) for r in requests)


def planes_of_labels(requests: Sequence[AovRequest]) -> tuple[str, ...]:
    """Return the planes of first hits that the AOVs of labels can take from a pass for others."""
    return PLANES if _measures(requests) else ()


def _seen_by(survey: Survey, parts: PartNames) -> Seen:
    index, depth = survey.frame()
    return Seen(index, parts, depth)


def _seen_of(prepared: Prepared, parts: PartNames) -> Seen:
    """Return what is seen through the pixels' centres; with a rolling shutter, at the time of each row."""
    scene, settings = prepared.scene, prepared.settings
    if prepared.rolls:
        index, depth = first_parts(scene, prepared.frame.pixels, parts, settings)
        return Seen(index, parts, depth)
    found = core.first_hits(scene, ["prim", "instance", "outer"], [], settings).planes
    what = np.concatenate([found["prim"], found["instance"], found["outer"]], axis=2).reshape(-1, 3)
    index = np.full(len(what), -1, np.int64)
    hit = what[:, 0] != -1
    index[hit] = parts.number(what[hit])
    shape = found["prim"].shape[:2]
    return Seen(index.reshape(shape), parts, np.zeros(shape, np.float32))


def _camera_facts(prepared: Prepared) -> dict[str, Any]:
    camera = prepared.camera
    world, ndc = exr_matrices(camera)
    is_perspective = camera.projection is Projection.PERSPECTIVE and not camera.is_panorama
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
    labelled, shown = prepared.labelled, set(np.unique(seen.index).tolist())
    texts = [
        ",".join(labelled.inherited(prim, instance, taxonomy)) if n in shown else ""
        for n, (prim, instance) in enumerate(seen.parts.names)
    ]
    numbers = {text: number for number, text in enumerate(sorted({text for text in texts if text}), start=1)}
    values = np.array([*(numbers.get(text, 0) for text in texts), 0], np.uint32)[seen.index]
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
    for number, ((prim, instance), text) in enumerate(zip(seen.parts.names, texts, strict=True)):
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
    """The things of one taxonomy in a picture, and their AOVs."""

    def __init__(self, prepared: Prepared, seen: Seen, taxonomy: str) -> None:
        assert prepared.labelled is not None
        self.things = TaxonomyThings(taxonomy, prepared.labelled, seen.parts)
        self._prepared, self._taxonomy = prepared, taxonomy
        self._places = np.append(self.things.places(), -1)[seen.index]  # (H, W); -1: none
        table = prepared.label_table or LabelTable()
        self._classes: Mapping[str, int] = table.classes.get(taxonomy, {})
        self._fixed: Mapping[str, int] = table.instances.get(taxonomy, {})
        self._ids: dict[str, int] = {}

    def give_ids(self, diagnostics: Diagnostics) -> None:
        """Give ids to all things that are known; clashes are reported, and kept in the label table."""
        names, settings = self.things.hierarchy.names, self._prepared.settings
        ids, clashes = ids_of_paths(names, self._fixed)
        if clashes and settings.label_table is not None:

            def extend(table: LabelTable) -> LabelTable:
                found, own = ids_of_paths(names, table.instances.get(self._taxonomy, {}))
                return table.with_instances(self._taxonomy, {path: found[path] for path in own})

            table, _ = extended_table(settings, extend)
            ids, _ = ids_of_paths(names, table.instances.get(self._taxonomy, {}))
        for path, other in clashes.items():
            diagnostics.add("label-clash", path, f"Its id by its path is that of {other}: it has {ids[path]}.")
        self._ids = ids

    def classes_aov(self, request: AovRequest) -> Aov:
        numbers = np.array([*(self._classes[name] for name in self.things.hierarchy.classes), 0], np.uint32)
        names = {number: name for name, number in sorted(self._classes.items(), key=lambda item: item[1])}
        return _ids_aov(request, numbers[self._places], names, f"class of {self._taxonomy}")

    def things_aov(self, request: AovRequest) -> Aov:
        paths = self.things.hierarchy.names
        numbers = np.array([*(self._ids[name] for name in paths), 0], np.uint32)
        shown = np.unique(self._places[self._places >= 0]).tolist()
        names = {self._ids[path]: path for path in sorted(paths[n] for n in shown)}
        return _ids_aov(request, numbers[self._places], names, f"labelled prim of {self._taxonomy}")

    def measured(self, seen: Seen, survey: Survey) -> list[Thing]:
        """Return the things in the picture or beside it, in the order of their paths, with all that is known of them."""
        hierarchy = self.things.hierarchy
        tight = _tight_boxes(self._places, hierarchy)
        measured = survey.measured(self.things, self._places, seen.depth)
        return [
            Thing(
                id=self._ids[hierarchy.names[n]],
                path=hierarchy.names[n],
                taxonomy=self._taxonomy,
                class_name=hierarchy.classes[n],
                class_id=self._classes[hierarchy.classes[n]],
                parent=None if hierarchy.parents[n] < 0 else self._ids[hierarchy.names[hierarchy.parents[n]]],
                box_tight=tight[n],
                **measured[n],
            )
            for n in sorted(measured, key=lambda n: hierarchy.names[n])
        ]


def _tight_boxes(places: Numbers, hierarchy: Hierarchy) -> list[Box | None]:
    """Return the box of each thing's pixels, with the things that it holds."""
    height, width = places.shape
    low = np.full((len(hierarchy.names), 2), max(height, width), np.int64)
    high = np.zeros((len(hierarchy.names), 2), np.int64)
    y, x = np.nonzero(places >= 0)
    own = places[y, x]
    for axis, at in enumerate((x, y)):
        np.minimum.at(low[:, axis], own, at)
        np.maximum.at(high[:, axis], own, at + 1)
    for n in reversed(range(len(hierarchy.names))):  # what a thing holds is after it
        parent = hierarchy.parents[n]
        if parent >= 0:
            low[parent], high[parent] = np.minimum(low[parent], low[n]), np.maximum(high[parent], high[n])
    return [tuple(box) if box[2] > box[0] else None for box in np.concatenate([low, high], axis=1).tolist()]
