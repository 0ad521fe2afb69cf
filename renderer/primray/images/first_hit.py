"""First-hit AOVs: outputs beside the picture, made from the core's data of what each pixel sees first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from .. import core
from ..aovs import WIDE, AovRequest, kind_of, occlusion_distance, primvar_of, primvars_of
from ..core.scene_record import SceneRecord
from ..description import Camera
from ..errors import LimitError
from ..settings import RenderSettings
from .aov import Aov, Values, make_aov

MOST_NUMBERS = 2**32 - 1
FILTERED_SAMPLES = 16  # samples per pixel: kFilteredSamples of the core's aov/first_hit.hpp
# The core's planes have the names of the AOVs; these AOVs are derived from other planes, or from none.
_MADE_OF: dict[str, tuple[str, ...]] = {"camera_normal": ("normal",), "samples": (), "instance": ("instance", "outer", "prim")}


def aovs_of(
    scene: core.CoreScene,
    requests: Sequence[AovRequest],
    camera: Camera,
    counts: npt.NDArray[np.uint32] | None,
    settings: RenderSettings,
) -> dict[str, Aov]:
    """Return AOVs by name, in the order of the requests; `counts` (R, H, W) are the film's, None where nothing is sampled."""
    return aovs_and_planes_of(scene, requests, camera, counts, settings, ())[0]


def aovs_and_planes_of(
    scene: core.CoreScene,
    requests: Sequence[AovRequest],
    camera: Camera,
    counts: npt.NDArray[np.uint32] | None,
    settings: RenderSettings,
    also: Sequence[str],
) -> tuple[dict[str, Aov], dict[str, Values]]:
    """Return AOVs as `aovs_of` does, and the planes `also`, of which others make theirs, from the same rays."""
    record = scene.record
    assert record is not None
    if counts is None:
        counts = np.zeros((1, *reversed(scene.resolution)), np.uint32)
    primvars = [name for name in primvars_of(requests) if record.width_of(name)]
    wanted = [(record.primvar_names[n], record.primvar_names[WIDE + n], record.width_of(n)) for n in primvars]
    planes = _planes_of(r.source for r in requests) | dict.fromkeys(also)
    hits = core.first_hits(scene, list(planes), wanted, settings)
    others = {name: hits.planes[name] for name in also}
    found = hits.planes | _occlusion(scene, requests, settings)
    found |= {f"primvar:{name}": values for name, values in zip(primvars, hits.primvars, strict=True)}
    errors = _errors(scene, requests, found, settings)
    made: dict[str, Aov] = {}
    ids = Ids(scene, record, record.names)
    for request in requests:
        made[request.name] = _aov(request, found, errors, camera, counts, scene.exposure_scale, ids)
    return made, others


def _planes_of(sources: Iterable[str]) -> dict[str, None]:
    """Return the core's planes that the sources need. Occlusion is excluded, because each distance has its own samples."""
    plain = (s for s in sources if primvar_of(s) is None and occlusion_distance(s) is None)
    return dict.fromkeys(plane for source in plain for plane in _MADE_OF.get(source, (source,)))


def _is_filtered(source: str) -> bool:
    kind = kind_of(source)
    return kind is not None and kind.filtered


def _occlusion(
    scene: core.CoreScene, requests: Sequence[AovRequest], settings: RenderSettings, replicate: int = 0
) -> dict[str, Values]:
    """Return ambient occlusion (H, W, 1) by source."""
    found = {}
    for source in dict.fromkeys(r.source for r in requests):
        if (distance := occlusion_distance(source)) is not None:
            hits = core.first_hits(scene, ["occlusion"], [], settings, replicate, distance)
            found[source] = hits.planes["occlusion"]
    return found


def _errors(
    scene: core.CoreScene, requests: Sequence[AovRequest], found: Mapping[str, Values], settings: RenderSettings
) -> dict[str, Values]:
    """Return standard errors (H, W, C) of filtered planes.

    Two independent sets of samples are compared: |a - b| / sqrt(2) is the error of a.
    """
    asked = [r for r in requests if r.errors and _is_filtered(r.source)]
    if not asked:
        return {}
    planes = _planes_of(r.source for r in asked)
    again = core.first_hits(scene, list(planes), [], settings, replicate=1).planes if planes else {}
    again |= _occlusion(scene, asked, settings, replicate=1)
    names = dict.fromkeys(r.source for r in asked)
    return {name: np.abs(found[name] - again[name]) * np.float32(np.sqrt(0.5)) for name in names}


def _aov(
    request: AovRequest,
    found: Mapping[str, Values],
    errors: dict[str, Values],
    camera: Camera,
    counts: npt.NDArray[np.uint32],
    exposure_scale: float,
    ids: Ids,
) -> Aov:
    source = request.source
    primvar = primvar_of(source)
    if primvar is not None:
        missing = np.zeros((*counts.shape[1:], 2 if source == "st" else 1), np.float32)
        values = found.get(f"primvar:{primvar}", missing)
        return make_aov(request, _two(values) if source == "st" else values)
    if source == "samples":
        return make_aov(request, counts.sum(axis=0, dtype=np.uint32)[..., None])
    if source == "camera_normal":
        return make_aov(request, (found["normal"] @ camera.world_from_camera[:3, :3]).astype(np.float32))
    if _is_filtered(source):
        scale = np.float32(exposure_scale if source == "emission" else 1)
        own = errors[source] * scale if request.errors else None
        return make_aov(request, found[source] * scale, errors=own, samples=FILTERED_SAMPLES)
    if source in ("prim", "material", "instance"):
        return make_aov(request, *getattr(ids, source)(found))
    return make_aov(request, found[source])


def _two(values: Values) -> Values:
    if values.shape[2] == 1:
        return np.concatenate([values, np.zeros_like(values)], axis=2)
    return values[..., :2]


class Ids:
    """Ids from 1 on, in name order, in place of the core's numbers, with the names of the ids that occur.

    `names` maps prim and material paths inside native prototypes to the names shown for them.
    """

    def __init__(self, scene: core.CoreScene, record: SceneRecord, names: Mapping[str, str]) -> None:
        self._scene = scene
        self._record = record
        self._names = names

    def prim(self, found: Mapping[str, Values]) -> tuple[Values, dict[int, str]]:
        record = self._record
        numbers, paths = _numbered(self._named(record.shape_paths))
        ids = _of_rows(found["prim"], *([numbers[shape] for shape, _ in rows] for rows in (record.meshes, record.curved)))
        return ids, _seen(ids, lambda n: paths[n - 1])

    def material(self, found: Mapping[str, Values]) -> tuple[Values, dict[int, str]]:
        rows = found["material"]
        numbers, paths = _numbered(self._named(self._record.surface_paths))
        ids = np.zeros(rows.shape, np.uint32)
        ids[rows >= 0] = numbers[rows[rows >= 0]]
        return ids, _seen(ids, lambda n: paths[n - 1])

    def named(self, path: str) -> str:
        """Return the name that is shown for the path of a prim or material."""
        return self._names.get(path, path)

    def _named(self, paths: Sequence[str]) -> Sequence[str]:
        return [self._names.get(path, path) for path in paths] if self._names else paths

    def instance(self, found: Mapping[str, Values]) -> tuple[Values, dict[int, str]]:
        """Return instance ids.

        Single instances, whose shapes are placed in the world directly, are numbered after the core's.
        """
        instances, record = self._scene.instance_numbers, self._record
        most = instances.most
        alone, names = _numbered([name for rows in (record.meshes, record.curved) for _, name in rows])
        if most + len(names) > MOST_NUMBERS:
            raise LimitError(f"{most} instances are more than an AOV's 32 bits can number", code="aov-instances")
        ids = instances.number(found["instance"], found.get("outer"))
        if names:
            numbers = np.where(alone > 0, alone + np.uint32(most), 0)
            at = len(record.meshes)
            ids = np.where(ids > 0, ids, _of_rows(found["prim"], numbers[:at], numbers[at:]))
        return ids, _seen(ids, lambda n: instances.name(n) if n <= most else names[n - most - 1])


def _of_rows(rows: Values, meshes: Sequence[int] | Values, curved: Sequence[int] | Values) -> Values:
    """Return ids for the core's rows of meshes and curved shapes, 0 where nothing was hit."""
    ids = np.zeros(rows.shape, np.uint32)
    ids[rows >= 0] = np.asarray(meshes, np.uint32)[rows[rows >= 0]]
    ids[rows <= -2] = np.asarray(curved, np.uint32)[-2 - rows[rows <= -2]]
    return ids


def _numbered(paths: Sequence[str]) -> tuple[npt.NDArray[np.uint32], list[str]]:
    """Return a number from 1 on for each path (0 for "", equal numbers for equal paths), and the paths by number."""
    different = sorted(set(paths) - {""})
    number = {path: n for n, path in enumerate(different, start=1)} | {"": 0}
    return np.array([number[path] for path in paths], np.uint32), different


def _seen(ids: Values, name: Callable[[int], str]) -> dict[int, str]:
    largest = int(ids.max(initial=0))
    present = np.flatnonzero(np.bincount(ids.ravel())) if largest < 1 << 24 else np.unique(ids)
    return {n: name(n) for n in present.tolist() if n}
