"""Lidar: beams by a pattern from a prim that may move, in a stage that may move, and what returns of them.

The scene is the one that a camera at the sensor would see: its surfaces are as fine as in a picture of all that is around,
2,048 pixels wide, and paths of motion are right to a fraction of such a pixel. The core traces beams (core/aov/returns.hpp);
what a detector makes of their returns is here.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from ..diagnostics import Diagnostics
from ..errors import SettingsError, did_you_mean
from ..render.interruption import interruption
from ..render.prepare import Steps, open_once, prepare
from ..render.render import with_setting_names
from ..settings import RenderSettings, StudioLight, with_values
from .lidar_pattern import Firings, LidarPattern
from .noise import Draws

if TYPE_CHECKING:
    from ..core.passes import Returns
    from ..description import SceneDescription
    from ..labels.layers import PartNames
    from ..report.prepared import Prepared
    from ..settings.written import SettingsValues
    from ..usd import LidarPrim

CODE = "lidar"
AROUND = (2048, 1024)  # pixels of the picture that the scene is made for
BAND = 1 << 18  # firings at a time
MOST_KEPT = 15  # returns of a firing: LAS counts them with four bits
KEPT = ("first", "strongest", "last")

POINT = np.dtype(
    [
        *[(name, "<f8") for name in ("x", "y", "z", "range")],
        *[("intensity", "<f4"), ("incidence", "<f4")],
        *[("return_number", "u1"), ("number_of_returns", "u1"), ("channel", "<u2"), ("column", "<u4"), ("firing", "<u4")],
        *[("azimuth", "<f8"), ("elevation", "<f8"), ("time", "<f8")],
        *[("object_id", "<u4"), ("class_id", "<u4"), ("part", "<i4")],
        *[(name, "<f8") for name in ("world_x", "world_y", "world_z")],
    ]
)

Points = npt.NDArray[Any]
Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class LidarDetector:
    """What a lidar makes of the light that returns.

    `returns` of each firing are kept, the `keep` ones ("first", "strongest" or "last") of those with an intensity of
    `min_intensity` or more. Surfaces nearer to each other than `separation_m` along a beam are one return, with the sum of
    their intensities and the rest of the strongest.

    Intensity is pi times a surface's BSDF back towards the sensor times the cosine, the mean of R, G and B by `weights`: 1 for
    a white Lambertian surface that faces the sensor, at any distance; with `reference_range_m` it falls with the square of the
    distance and is so at that one. Reflections are as wide as of a roughness of sqrt(`beam_alpha`) at least.

    Ranges have normal noise with the standard deviation `range_noise_m`, a function of `seed` and firing.

    >>> primray.LidarDetector(returns=2, keep="last", range_noise_m=0.02).min_intensity
    0.001

    SettingsError `lidar` for values that no detector has.
    """

    returns: int = 3
    keep: str = "strongest"
    separation_m: float = 0.1
    min_intensity: float = 1e-3
    weights: tuple[float, float, float] = (1.0, 0.0, 0.0)
    reference_range_m: float | None = None
    beam_alpha: float = 0.05
    range_noise_m: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        def need(holds: bool, sentence: str, where: str) -> None:
            if not holds:
                raise SettingsError(sentence, where=where, code=CODE)

        need(1 <= self.returns <= MOST_KEPT, f"a firing has 1 to {MOST_KEPT} returns, not {self.returns}", "returns")
        near = did_you_mean(self.keep, KEPT) or f"one of {', '.join(KEPT)}"
        need(self.keep in KEPT, f"returns to keep cannot be {self.keep!r}; {near}", "keep")
        for name in ("separation_m", "min_intensity", "range_noise_m"):
            need(0 <= getattr(self, name) < math.inf, f"{name} must be 0 or more, not {getattr(self, name)!r}", name)
        sums = len(self.weights) == 3 and all(0 <= w <= 1 for w in self.weights) and abs(sum(self.weights) - 1) < 1e-6
        need(sums, "weights are of R, G and B, 0 or more, and their sum is 1", "weights")
        reference = self.reference_range_m
        need(reference is None or 0 < reference < math.inf, "the reference range must be above 0", "reference_range_m")
        need(1e-3 <= self.beam_alpha <= 1, "beam_alpha must be 0.001 to 1", "beam_alpha")
        need(0 <= self.seed < 1 << 64, "seed must be a whole number from 0 below 2^64", "seed")


@dataclass(frozen=True, eq=False)
class LidarScan:
    """The points of a frame, and what their numbers mean.

    `points` (N) has a field for each property: `x`, `y`, `z`, `range` in metres, in the sensor's axes when the point's beam was
    fired (x forward, y left, z up); `world_x`, `world_y`, `world_z` in scene units; `intensity`; `incidence`, the cosine at the
    surface; `return_number` of `number_of_returns`, by distance, from 1; `channel`, `column` (azimuth step), `firing`;
    `azimuth` and `elevation` in degrees; `time` in seconds after the frame; `object_id` and `class_id`, 0: none; `part`, a row
    of `parts`.

    >>> ahead = primray.LidarPattern.rotating(elevations_deg=[0], steps=4)
    >>> scan = primray.lidar("shot.usda", [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]], ahead)
    >>> scan.misses == scan.firings - len(set(scan.points["firing"].tolist()))
    True
    >>> scan.save("scan.pcd", axes="world").name
    'scan.pcd'
    """

    points: Points
    parts: tuple[tuple[str, str], ...]  # path of the prim, and name of its instance; "": none
    classes: Mapping[int, str]
    objects: Mapping[int, str]  # paths of labelled prims in the scan
    sensor: str  # path of its prim; "": a matrix
    pattern: LidarPattern
    detector: LidarDetector
    world_from_sensor: Doubles  # (4, 4) when the frame begins, scene units
    meters_per_unit: float
    firings: int
    hits: int  # firings with a return
    diagnostics: Diagnostics = field(default_factory=Diagnostics)

    @property
    def misses(self) -> int:
        """Firings without a return: nothing is there within range, or it sends too little back."""
        return self.firings - self.hits

    def positions(self, axes: str = "sensor") -> Doubles:
        """Return the points (N, 3) in metres: in the sensor's axes as each beam was fired ("sensor") or as the frame begins
        ("start"), which takes the sensor's motion out; or in the world ("world")."""
        check_axes(axes)
        names = ("x", "y", "z") if axes == "sensor" else ("world_x", "world_y", "world_z")
        found = np.stack([self.points[name] for name in names], axis=1)
        if axes == "start":
            away = found - self.world_from_sensor[:3, 3]
            found = _rotated(self.world_from_sensor[:3, :3].T, away)
        return np.asarray(found if axes == "sensor" else found * self.meters_per_unit, np.float64)

    def save(self, path: str | os.PathLike[str], axes: str = "sensor") -> Path:
        """Write a .npy (all fields), .pcd or .las with positions in these axes; SettingsError `unknown-format` for others.

        The last needs `pip install primray[lidar]`.
        """
        from .lidar_files import write

        return write(self, Path(path), axes)

    def as_json(self) -> dict[str, Any]:
        """Return everything but the points."""
        detector = {name: getattr(self.detector, name) for name in LidarDetector.__dataclass_fields__}
        return {
            "sensor": self.sensor,
            "firings": self.firings,
            "hits": self.hits,
            "misses": self.misses,
            "points": len(self.points),
            "world_from_sensor": self.world_from_sensor.tolist(),
            "meters_per_unit": self.meters_per_unit,
            "detector": detector,
            "pattern": self.pattern.as_json(),
            "classes": {str(number): name for number, name in self.classes.items()},
            "objects": {str(number): path for number, path in self.objects.items()},
            "parts": [{"prim": prim, "instance": instance} for prim, instance in self.parts],
            "diagnostics": [one.as_json() for one in self.diagnostics],
        }


AXES = ("sensor", "start", "world")


def check_axes(axes: str) -> None:
    """Raise SettingsError for axes that positions cannot be in."""
    if axes not in AXES:
        near = did_you_mean(axes, AXES) or f"one of {', '.join(AXES)}"
        raise SettingsError(f"points cannot be in {axes!r}; {near}", where="axes", code=CODE)


@with_setting_names
def lidar(
    stage: str | os.PathLike[str] | Any,
    sensor: str | npt.ArrayLike | None = None,
    pattern: LidarPattern | str | os.PathLike[str] | None = None,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    detector: LidarDetector = LidarDetector(),
    taxonomy: str = "class",
    **values: Unpack[SettingsValues],
) -> LidarScan:
    """Return the points that a lidar measures in one frame of a stage, given as a Usd.Stage or a path.

    `sensor` is the path, or the unique name, of its prim: x of an Xform is forward and z up; a Camera looks along its view. It
    may be world_from_sensor (4, 4) for column vectors, in scene units. None: the stage's only prim with lidar attributes.
    `pattern` is a LidarPattern, a .json or .csv file, or a name; None: as the prim says, else "rotating-32". The frame begins
    at `time_code`; each beam sees the stage, and starts from the sensor, when it is fired. `taxonomy` is that of the labels.

    >>> pattern = primray.LidarPattern.rotating(elevations_deg=[0], steps=8)
    >>> scan = primray.lidar("shot.usda", [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]], pattern)
    >>> scan.firings, scan.points.dtype.names[:4]
    (8, ('x', 'y', 'z', 'range'))

    SettingsError `lidar-sensor`, `lidar-pattern` or `lidar` for what is no sensor, pattern or detector.
    """
    from .. import usd
    from ..diagnostic_messages import Announcer
    from ..report.report import Costs

    settings = with_values(settings, values)
    opened = open_once(stage, settings)
    diagnostics = Diagnostics()
    codes_per_second = usd.lidar_units(opened.stage)[1]
    prim, given = _sensor_of(opened.stage, sensor, settings, diagnostics)
    chosen = _pattern_of(pattern, prim)
    firings = chosen.firings()
    if prim is None:
        assert given is not None
        times, poses = firings.time_s[:1], given[None]
    else:
        times, poses = usd.lidar_poses(opened.stage, prim.path, settings.time_code, np.append(0.0, firings.time_s))
    closes = chosen.duration_s * codes_per_second
    scene_settings = _settings_around(settings, poses[0], closes)
    steps = _Steps(closes)
    prepared = prepare(opened.stage, opened.diagnostics, scene_settings, Costs(), diagnostics, steps=steps)
    Announcer(opened.name).tell(diagnostics)
    scanning = _Scanning(prepared, chosen, firings, times, poses, detector, usd.lidar_units(opened.stage)[0])
    points, parts = scanning.points()
    named = _Named(opened.stage, prepared, taxonomy, diagnostics)
    classes, objects = named.label(points, parts)
    kept, rows = np.unique(points["part"], return_inverse=True)
    points["part"] = rows
    return LidarScan(
        points=points,
        parts=tuple(parts.names[row] for row in kept.tolist()),
        classes=classes,
        objects=objects,
        sensor="" if prim is None else prim.path,
        pattern=chosen,
        detector=detector,
        world_from_sensor=poses[0],
        meters_per_unit=scanning.meters,
        firings=chosen.count,
        hits=len(np.unique(points["firing"])),
        diagnostics=diagnostics,
    )


def _sensor_of(
    stage: Any, sensor: str | npt.ArrayLike | None, settings: RenderSettings, diagnostics: Diagnostics
) -> tuple[LidarPrim | None, Doubles | None]:
    """Return the sensor's prim, or its matrix."""
    from .. import usd

    if sensor is None or isinstance(sensor, str):
        return usd.lidar_prim(stage, sensor, settings.time_code, diagnostics), None
    try:
        matrix = np.array(sensor, np.float64)
    except (TypeError, ValueError):
        raise SettingsError("a sensor is a prim's path, or a matrix (4, 4)", where="sensor", code="lidar-sensor") from None
    is_rigid = matrix.shape == (4, 4) and np.isfinite(matrix).all() and np.array_equal(matrix[3], [0, 0, 0, 1])
    if not is_rigid or not np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-6) or np.linalg.det(matrix) < 0:
        sentence = "a sensor's matrix is (4, 4) and rigid: world_from_sensor for column vectors"
        raise SettingsError(sentence, where="sensor", code="lidar-sensor")
    return None, matrix


def _pattern_of(pattern: LidarPattern | str | os.PathLike[str] | None, prim: LidarPrim | None) -> LidarPattern:
    if isinstance(pattern, LidarPattern):
        return pattern
    if pattern is not None:
        name = os.fspath(pattern)
        is_file = Path(name).suffix.lower() in (".csv", ".json") or Path(name).is_file()
        return LidarPattern.read(name) if is_file else LidarPattern.named(name)
    return LidarPattern.of(prim.authored if prim is not None else {}, "" if prim is None else prim.path)


def _settings_around(settings: RenderSettings, pose: Doubles, closes: float) -> RenderSettings:
    """Return the settings of a picture of all that is around the sensor, with a shutter that is open for the frame."""
    from ..camera import Camera

    return replace(
        settings,
        camera=Camera.lat_long(pose),
        panorama=None,
        eye=None,
        resolution=AROUND,
        resolution_scale=1.0,
        region=None,
        aovs=("prim",),
        shutter=(0.0, closes),
        motion_blur=closes > 0 and settings.motion_blur,
        studio_light=StudioLight.OFF,
    )


class _Steps(Steps):
    """The pipeline of a scan, which reports a stage that allows no motion."""

    def __init__(self, closes: float) -> None:
        self._closes = closes

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        description, diagnostics = super().translate(stage, settings)
        exposure = description.exposure
        if settings.motion_blur and exposure is not None and exposure.span[1] < self._closes:
            message = "The stage's render product closes the shutter at once: everything stays where it is at the frame."
            diagnostics.add("render-settings-input", "", message)
        return description, diagnostics


class _Scanning:
    """One frame of a sensor in a scene."""

    def __init__(
        self,
        prepared: Prepared,
        pattern: LidarPattern,
        firings: Firings,
        times: Doubles,
        poses: Doubles,
        detector: LidarDetector,
        meters: float,
    ) -> None:
        self._scene, self._settings = prepared.scene, prepared.settings
        self._pattern, self._firings, self._detector = pattern, firings, detector
        self._times, self._poses = times, poses
        self.meters = meters  # of a scene unit
        shutter = self._settings.shutter
        self._closes_s = pattern.duration_s if shutter is not None and shutter[1] > 0 and self._settings.motion_blur else 0.0

    def points(self) -> tuple[Points, PartNames]:
        """Return the points, without labels, with numbers of parts."""
        from ..labels.layers import PartNames

        parts = PartNames(self._scene)
        bands = []
        with interruption() as asked:
            for begin in range(0, self._pattern.count, BAND):
                bands.append(self._band(begin, min(begin + BAND, self._pattern.count), parts))
                if asked.asked:
                    raise KeyboardInterrupt
        return np.concatenate(bands), parts

    def _band(self, begin: int, end: int, parts: PartNames) -> Points:
        from .. import core

        firings, detector = self._firings, self._detector
        directions, times = firings.directions[begin:end], firings.time_s[begin:end]
        rotations, origins = self._poses_at(times)
        world = _rotated(rotations, directions)
        moment = np.zeros(end - begin, np.float32)
        if self._closes_s > 0:
            moment = np.minimum(times / self._closes_s, 1.0).astype(np.float32)
        near, far = (length / self.meters for length in self._pattern.range_m)
        weights = detector.weights
        found = core.returns(self._scene, (origins, world, moment), (near, far), weights, detector.beam_alpha, self._settings)
        firing, echoes = detected(found, self.meters, self._pattern.range_m[1], detector)
        points = np.zeros(len(echoes.row), POINT)
        ranges = echoes.range
        number, count = _numbered(firing)
        points["return_number"], points["number_of_returns"] = number, count
        if detector.range_noise_m > 0:
            # A deviate belongs to firing and return, however many others there are.
            draw = Draws(detector.seed, begin // BAND).normal(BAND * detector.returns)
            ranges = ranges + detector.range_noise_m * draw[firing * detector.returns + number - 1]
        points["range"], points["intensity"], points["incidence"] = ranges, echoes.intensity, found.cosine[echoes.row]
        local = directions[firing] * ranges[:, None]
        points["x"], points["y"], points["z"] = local.T
        at = origins[firing] + world[firing] * (ranges / self.meters)[:, None]
        points["world_x"], points["world_y"], points["world_z"] = at.T
        points["firing"] = firing + begin
        for name, values in (
            ("channel", firings.channel),
            ("column", firings.column),
            ("azimuth", firings.azimuth_deg),
            ("elevation", firings.elevation_deg),
            ("time", firings.time_s),
        ):
            points[name] = values[begin:end][firing]
        points["part"] = parts.number(found.what[echoes.row, :3])
        return points

    def _poses_at(self, times: Doubles) -> tuple[Doubles, Doubles]:
        """Return rotations (N, 3, 3), or (3, 3) of a sensor that stands still, and origins (N, 3), at the times of firings."""
        if len(self._poses) == 1:
            return self._poses[0, :3, :3], np.broadcast_to(self._poses[0, :3, 3], (len(times), 3))
        after = np.clip(np.searchsorted(self._times, times, side="right"), 1, len(self._times) - 1)
        a, b = self._poses[after - 1], self._poses[after]
        u = (times - self._times[after - 1]) / (self._times[after] - self._times[after - 1])
        mixed = a[:, :3] + (b[:, :3] - a[:, :3]) * u[:, None, None]
        return _orthonormal(mixed[:, :, :3]), mixed[:, :, 3]


def _rotated(rotation: Doubles, vectors: Doubles) -> Doubles:
    """Return vectors (N, 3) rotated by one matrix or by one each; by products that no library orders anew."""
    columns = [rotation[..., k] * vectors[:, k, None] for k in range(3)]
    return np.asarray(columns[0] + columns[1] + columns[2])


def _orthonormal(rows: Doubles) -> Doubles:
    """Return the rotations (N, 3, 3) next to matrices that are almost ones (Gram-Schmidt)."""
    x, y = rows[..., 0], rows[..., 1]
    x = x / np.sqrt((x * x).sum(axis=1, keepdims=True))
    y = y - x * (x * y).sum(axis=1, keepdims=True)
    y = y / np.sqrt((y * y).sum(axis=1, keepdims=True))
    return np.stack([x, y, np.cross(x, y)], axis=2)


@dataclass(frozen=True)
class Echoes:
    """Returns that a detector tells apart: rows of the core's returns (M), ranges in metres and intensities."""

    row: Numbers
    range: Doubles
    intensity: Floats


def detected(found: Returns, meters: float, far: float, detector: LidarDetector) -> tuple[Numbers, Echoes]:
    """Return the firings (M) and echoes of what a detector tells apart and keeps, ordered by firing and range."""
    firing = np.repeat(np.arange(len(found.count)), found.count)
    ranges = found.distance * meters
    strength = found.strength.astype(np.float64)
    if detector.reference_range_m is not None:
        strength = strength * (detector.reference_range_m / np.maximum(ranges, 1e-9)) ** 2
    row = np.flatnonzero(ranges <= far)
    row, strength = _merged(firing, ranges, strength, row, detector.separation_m)
    held = strength >= max(detector.min_intensity, 1e-30)
    row, strength = row[held], strength[held]
    kept = _kept(firing[row], strength, detector)
    row, strength = row[kept], strength[kept]
    return firing[row], Echoes(row, ranges[row], strength.astype(np.float32))


def _merged(firing: Numbers, ranges: Doubles, strength: Doubles, row: Numbers, apart: float) -> tuple[Numbers, Doubles]:
    """Return the rows that stand for each group of returns without a gap of `apart` metres: the strongest, and their sums."""
    strength = strength[row]
    if len(row) < 2 or apart <= 0:
        return row, strength
    joins = (firing[row][1:] == firing[row][:-1]) & (ranges[row][1:] - ranges[row][:-1] < apart)
    if not joins.any():
        return row, strength
    starts = np.flatnonzero(np.append(True, ~joins))
    group = np.cumsum(np.append(True, ~joins)) - 1
    by_strength = np.lexsort((np.arange(len(row)), -strength, group))
    return row[by_strength[starts]], np.add.reduceat(strength, starts)


def _kept(firing: Numbers, strength: Doubles, detector: LidarDetector) -> Numbers:
    """Return the places, ascending, of the returns that are kept; `firing` ascends."""
    number, count = _numbered(firing)
    if not (count > detector.returns).any():
        return np.arange(len(firing))
    if detector.keep == "first":
        return np.flatnonzero(number <= detector.returns)
    if detector.keep == "last":
        return np.flatnonzero(number > count - detector.returns)
    by_strength = np.lexsort((np.arange(len(firing)), -strength, firing))
    return np.sort(by_strength[number <= detector.returns])


def _numbered(firing: Numbers) -> tuple[Numbers, Numbers]:
    """Return the number of each return in its firing, from 1, and how many that has."""
    if not len(firing):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    starts = np.flatnonzero(np.append(True, firing[1:] != firing[:-1]))
    counts = np.diff(np.append(starts, len(firing)))
    return np.arange(len(firing)) - np.repeat(starts, counts) + 1, np.repeat(counts, counts)


class _Named:
    """The labels of a stage in one taxonomy."""

    def __init__(self, stage: Any, prepared: Prepared, taxonomy: str, diagnostics: Diagnostics) -> None:
        from .. import usd

        self._labelled = usd.LabelledPrims(stage, prepared.settings.time_code)
        self._known = self._labelled.taxonomies()
        self._taxonomy, self._settings, self._diagnostics = taxonomy, prepared.settings, diagnostics
        if taxonomy not in self._known and (self._known and taxonomy != "class"):
            message = f"No prim has labels in the taxonomy {taxonomy}: labels are in {', '.join(self._known)}."
            diagnostics.add("label-taxonomy", "", message)

    def label(self, points: Points, parts: PartNames) -> tuple[dict[int, str], dict[int, str]]:
        """Set ids of objects and classes; return the names of those that points have."""
        from ..labels.layers import TaxonomyThings
        from ..labels.table import class_ids
        from ..labels.things import ids_of_paths

        if self._taxonomy not in self._known or not len(points):
            return {}, {}
        table = class_ids(self._settings, {self._taxonomy: self._known[self._taxonomy]}, self._diagnostics)
        things = TaxonomyThings(self._taxonomy, self._labelled, parts)
        places = things.places()
        hierarchy = things.hierarchy
        ids, clashes = ids_of_paths(hierarchy.names, table.instances.get(self._taxonomy, {}))
        for path, other in clashes.items():
            self._diagnostics.add("label-clash", path, f"Its id by its path is that of {other}: it has {ids[path]}.")
        classes = table.classes[self._taxonomy]
        objects = np.array([*(ids[name] for name in hierarchy.names), 0], np.uint32)
        kinds = np.array([*(classes[name] for name in hierarchy.classes), 0], np.uint32)
        of_point = places[points["part"]]
        points["object_id"], points["class_id"] = objects[of_point], kinds[of_point]
        shown = [n for n in np.unique(of_point).tolist() if n >= 0]
        return (
            dict(sorted({classes[hierarchy.classes[n]]: hierarchy.classes[n] for n in shown}.items())),
            {ids[hierarchy.names[n]]: hierarchy.names[n] for n in shown},
        )
