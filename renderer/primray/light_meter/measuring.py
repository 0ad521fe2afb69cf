"""Measuring light on a stage: `primray measure` and `primray.measure`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from .. import usd
from ..description import SceneDescription
from ..diagnostics import Diagnostics
from ..errors import SettingsError
from ..render.prepare import OpenedStage, Steps, Textures, open_once, prepare
from ..render.render import with_setting_names
from ..report.report import Costs
from ..sampling.sampling import Sampling
from ..settings import RenderSettings, with_values
from .facets import (
    APART,
    FARTHEST_CYLINDERS,
    FARTHEST_TOGETHER,
    SIDES,
    Facets,
    camera_of,
    clusters,
    dicing_camera,
    facets_of,
    groups_apart,
    half_width,
    with_facets,
)
from .meters import CODE, LightMeter, MeterGrid, MeterKind, Meters, as_vector
from .pictures import LightSteps, sampled, settings_of_light
from .readings import GridReading, Measured, Precision, PrecisionJudge, Reading, grids_of, readings_of
from .sky import OUTSIDE, under_overcast_sky

if TYPE_CHECKING:
    from ..diagnostics import Diagnostic
    from ..sampling.sampling import Progress
    from ..settings.written import SettingsValues

MOST_SAMPLES = 1 << 16  # of each of a meter's pixels


@dataclass(frozen=True)
class Measurement:
    """Readings of all meters, in lux, or as shares of 1 for daylight factors; grids; and how they were taken.

    >>> measurement = primray.measure("shot.usda", [primray.LightMeter("ground", (0.0, 0.0, 3.0))], target=0.2)
    >>> measurement["ground"].met, measurement["ground"].value > 0
    (True, True)
    """

    readings: tuple[Reading, ...]
    grids: tuple[GridReading, ...]
    is_daylight_factor: bool
    maintenance_factor: float
    report: Mapping[str, Any]

    def __getitem__(self, name: str) -> Reading:
        found = next((reading for reading in self.readings if reading.meter.name == name), None)
        if found is None:
            raise KeyError(name)
        return found

    @property
    def met(self) -> bool:
        """Whether all readings are as precise as asked."""
        return all(reading.met for reading in self.readings)

    def as_json(self) -> dict[str, Any]:
        kind = "daylight-factor" if self.is_daylight_factor else "illuminance"
        return {
            "type": "measurement",
            "quantity": kind,
            "unit": "1" if self.is_daylight_factor else "lx",
            "met": self.met,
            "maintenance_factor": self.maintenance_factor,
            "readings": [reading.as_json() for reading in self.readings],
            "grids": [grid.as_json() for grid in self.grids],
            **self.report,
        }


class _MeterSteps(LightSteps):
    """The steps of a picture of light, with facets for the meters in the scene, and under the overcast sky if that is asked."""

    def __init__(self, facets: Facets, *, is_overcast: bool) -> None:
        self._facets, self._is_overcast = facets, is_overcast

    def translate(self, stage: Any, settings: RenderSettings) -> tuple[SceneDescription, Diagnostics]:
        description, told = super().translate(stage, settings)
        return with_facets(description, self._facets), told

    def load_textures(
        self, description: SceneDescription, diagnostics: Diagnostics, settings: RenderSettings
    ) -> tuple[SceneDescription, Textures]:
        if not self._is_overcast:
            return super().load_textures(description, diagnostics, settings)
        description, sky = under_overcast_sky(description)
        lights = description.lights
        description, textures = Steps.load_textures(self, replace(description, lights=()), diagnostics, settings)
        return replace(description, lights=lights), {**textures, **sky}


@with_setting_names
def measure(
    stage: str | os.PathLike[str] | Any,
    meters: Iterable[LightMeter | MeterGrid] | None = None,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    target: float = 0.02,
    of_mean: bool = False,
    simultaneous: bool = False,
    daylight_factor: bool = False,
    maintenance_factor: float = 1.0,
    progress: Progress | None = None,
    **values: Unpack[SettingsValues],
) -> Measurement:
    """Measure light at meters on a stage, given as a Usd.Stage or as a path, until each reading's 95 % interval is within
    `target` times its value.

    >>> measurement = primray.measure("shot.usda", [primray.LightMeter("here", (0.0, 0.0, 3.0))], target=0.2, seed=1)
    >>> measurement.readings[0].low < measurement.readings[0].value < measurement.readings[0].high
    True

    `meters`: points and grids; None: those that the stage has (PrimrayLightMeterAPI). `of_mean`: the mean of each grid is to be
    that precise, not each meter of it. `simultaneous`: the intervals hold all together with 95 %. `daylight_factor`: shares of
    the illuminance of the open ground under the CIE's overcast sky, with all other lights off. `maintenance_factor`: light that
    is left when lamps and surfaces have aged; all readings are multiplied by it.

    Readings are lux where the stage's lights are photometric: UsdLux's unit of radiance is a nit. Meters that get less than a
    thousandth of what the brightest gets need only as many lux of precision as if they got that much. Fields of RenderSettings
    may be given by name: `spp` is the most samples of each of a meter's 64 pixels (65,536; at least 2), `time_limit_s` the most
    seconds. Those of the camera and the picture have no effect, nor have the render settings of the stage.

    Raises SettingsError, SceneError or LimitError as `primray.render` does, LimitError also where the time limit leaves a meter
    without a reading; KeyboardInterrupt where Ctrl-C stops it.
    """
    settings = with_values(settings, values)
    if not (isinstance(maintenance_factor, int | float) and 0 < maintenance_factor <= 1):
        raise SettingsError(f"a maintenance factor is above 0, at most 1, not {maintenance_factor!r}", code=CODE)
    Precision(target)  # checks it before the stage is opened
    found = stage if isinstance(stage, OpenedStage) else open_once(stage, settings)
    opened, opening, diagnostics, costs = found.stage, found.diagnostics, Diagnostics(), Costs()
    costs.stages_s["open"] = found.seconds
    authored = usd.authored_meters(opened, settings.time_code, diagnostics)
    given = [_of_prim(one) for one in authored.meters] if meters is None else meters
    meters_of_all = Meters.of(given, authored.meters_per_unit, authored.up)
    positions = meters_of_all.positions()
    precision = Precision(target, of_mean, simultaneous, len(positions))
    measured, passes = Measured.none(len(positions)), list[Sampling]()
    groups = _groups(meters_of_all, authored.meters_per_unit)
    told = [diagnostics]  # all groups are told the same

    def sample(group: list[int], half: float, brightest: float | None, shown: Callable[[float, int, int], bool]) -> None:
        meters_here = Meters(tuple(meters_of_all.meters[k] for k in group), meters_of_all.up)
        facets = facets_of(meters_here, half)
        steps = _MeterSteps(facets, is_overcast=daylight_factor)
        here = told.pop() if told else Diagnostics()
        prepared = steps.as_sampled(prepare(opened, opening, _asked(settings, facets), costs, here, steps=steps))
        judge = PrecisionJudge(meters_here.meters, precision, brightest)
        passes.append(sampled(prepared, costs, judge, shown))
        measured.put(group, Measured.of(passes[-1], len(group)))
        if not steps.has_light:
            measured.samples[group] = math.inf  # no number of samples would find any

    for number, (group, half) in enumerate(groups):
        sample(group, half, None, partial(_shown, progress, number, len(groups)))
    # Search longer for the light of meters that seem to get none.
    seemingly_dark = measured.is_unlit & ~measured.is_sought(precision) & (measured.samples < SIDES * most_samples(settings))
    has_time = all(sampling.stop is None or sampling.stop.reason != "time-limit" for sampling in passes)
    for group, half in groups if has_time else ():
        if dark := [k for k in group if seemingly_dark[k]]:
            sample(dark, half, float(measured.values.max()), partial(_shown, progress, len(groups), len(groups)))
    unit = OUTSIDE / maintenance_factor if daylight_factor else 1 / maintenance_factor
    measured = measured.over(unit)
    readings = readings_of(measured, meters_of_all.meters, precision)
    if np.isfinite(measured.samples).all():
        _note_darkness(readings, diagnostics)
    return Measurement(
        tuple(readings),
        tuple(grids_of(measured, readings)),
        daylight_factor,
        maintenance_factor,
        _report(passes, costs, precision, [*opening, *diagnostics]),
    )


def _groups(meters: Meters, meters_per_unit: float) -> list[tuple[list[int], float]]:
    """Return the numbers of meters that are measured together, and half the width of their facets in scene units."""
    positions, found = meters.positions(), []
    for is_cylindrical, farthest in ((False, FARTHEST_TOGETHER), (True, FARTHEST_CYLINDERS)):
        alike = [k for k, one in enumerate(meters.meters) if (one.kind is MeterKind.CYLINDRICAL) is is_cylindrical]
        for among in clusters(positions[alike], farthest / meters_per_unit) if alike else ():
            near = [alike[k] for k in among]
            half = half_width(positions[near], meters_per_unit, is_cylindrical=is_cylindrical)
            found += [([near[k] for k in group], half) for group in groups_apart(positions[near], 2 * APART * half)]
    return found


def most_samples(settings: RenderSettings) -> int:
    """Return the most samples of each of a meter's pixels."""
    return MOST_SAMPLES if settings.spp is None else settings.spp


def _asked(settings: RenderSettings, facets: Facets) -> RenderSettings:
    """Return the settings of a picture of the facets."""
    camera, resolution = camera_of(facets)
    asked = settings_of_light(settings)
    return replace(
        asked,
        camera=camera,
        resolution=resolution,
        dicing_camera=dicing_camera(facets, resolution),
        spp=most_samples(settings),
        filter_width=0.5,
    )


def _shown(progress: Progress | None, number: int, of: int, fraction: float, samples: int, rays: int) -> bool:
    return progress is None or progress(min((number + fraction) / of, 1.0), samples, rays) is not False


def _of_prim(one: usd.AuthoredMeter) -> LightMeter | MeterGrid:
    """Return the meter of a prim, which looks along its -Z."""
    x, y, z, origin = one.world_from_prim[:3].T
    look = -np.cross(x, y)
    if look @ z > 0:  # mirrored
        look = -look
    if not np.any(look):
        raise SettingsError("a light meter's prim is flat: its matrix is singular", where=one.path, code=CODE)
    is_upright = one.kind == MeterKind.CYLINDRICAL.value
    direction = None if is_upright else as_vector(look)
    width, height = one.size
    if not (width or height):
        return LightMeter(one.path, as_vector(origin), direction, one.kind)  # type: ignore[arg-type]
    columns, rows = (int(n) for n in one.counts)
    return MeterGrid(
        one.path,
        as_vector(origin - x * width / 2 - y * height / 2),
        as_vector(x * width),
        as_vector(y * height),
        None if (columns, rows) == (0, 0) else (columns, rows),
        None if one.border < 0 else one.border,
        direction,
        one.kind,  # type: ignore[arg-type]
    )


def _note_darkness(readings: Sequence[Reading], diagnostics: Diagnostics) -> None:
    """Report meters for which no sample found light: in the dark, or inside of something."""
    dark = [reading.meter.name for reading in readings if reading.value == 0]
    if dark:
        more = f" and {len(dark) - 1} more" if len(dark) > 1 else ""
        place = "it is dark there, or the meter is inside of something or faces it"
        message = f"No sample found light at {dark[0]}{more}: {place}."
        diagnostics.add("dark-light-meter", "", message)


def _report(passes: list[Sampling], costs: Costs, precision: Precision, told: list[Diagnostic]) -> dict[str, Any]:
    reasons = [sampling.stop.reason for sampling in passes if sampling.stop is not None]
    stop = next((reason for reason in reasons if reason != "target-error"), "target-error")
    return {
        "target": precision.target,
        "target_of": "mean" if precision.of_mean else "each",
        "intervals": "simultaneous" if precision.simultaneous else "each",
        "samples": max(sampling.done for sampling in passes) * SIDES,  # of a meter
        "rays": sum(sampling.film.rays for sampling in passes),
        "seconds": sum(sampling.seconds for sampling in passes),
        "stages_s": dict(costs.stages_s),
        "stop": "precision" if stop == "target-error" else stop,
        "seed": passes[0].settings.seed,
        "diagnostics": [diagnostic.as_json() for diagnostic in told],
    }
