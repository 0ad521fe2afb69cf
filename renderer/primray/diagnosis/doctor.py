"""Diagnosis of a stage that comes out slow, grey, dark or empty: `primray doctor` and `primray.doctor`, and its text."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack, overload

from ..diagnostic_messages import diagnostics_lines, fidelity_text
from ..errors import SettingsError
from ..render.render import with_setting_names
from ..settings import RenderSettings, with_values

if TYPE_CHECKING:
    from ..diagnostics import Diagnostic
    from ..settings.written import SettingsValues
    from .examination import Finding
    from .machine import MachineCheck


PILOT_S = 3.0
SMALLEST_TARGET = 1e-30  # below any error that may be asked for, so that the predicted render has no other end


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """Measurements of a stage from a few seconds of rendering, and the findings that follow.

    >>> diagnosis = primray.doctor("shot.usda", resolution=(32, 18), pilot_seconds=0.1)
    >>> diagnosis.resolution, all(finding.advice for finding in diagnosis.findings)
    ((32, 18), True)
    """

    scene: str
    camera: str  # the prim's path; "": an automatic one
    resolution: tuple[int, int]
    hit_share: float  # fraction of the picture's pixels that see a surface
    grey_share: float | None  # fraction of these with grey surfaces; None: no surface is seen
    bounds: tuple[tuple[float, ...], ...] | None  # lower and upper corner of the scene; None: it is empty
    camera_position: tuple[float, ...]  # in scene units
    meters_per_unit: float
    up_axis: str
    lights: tuple[tuple[str, str], ...]  # path and type
    set_up_s: Mapping[str, float]  # seconds before the first sample, by step
    speed: Mapping[str, Any]  # rays and samples a second
    counts: Mapping[str, int]
    time_to_1_percent: Mapping[str, Any] | None  # samples and seconds to relMSE 0.0001, with 95 % intervals; None: unknown
    findings: tuple[Finding, ...]
    diagnostics: tuple[Diagnostic, ...]

    def as_json(self) -> dict[str, Any]:
        """Return what `primray doctor SCENE --json` prints."""
        return {
            "type": "doctor",
            "scene": self.scene,
            "picture": {
                "camera": self.camera,
                "resolution": list(self.resolution),
                "hit_share": self.hit_share,
                "grey_share": self.grey_share,
                "bounds": None if self.bounds is None else [list(corner) for corner in self.bounds],
                "camera_position": list(self.camera_position),
                "meters_per_unit": self.meters_per_unit,
                "up_axis": self.up_axis,
                "lights": [{"path": path, "type": kind} for path, kind in self.lights],
            },
            "set_up_s": dict(self.set_up_s),
            "speed": dict(self.speed),
            "counts": dict(self.counts),
            "time_to_1_percent": None if self.time_to_1_percent is None else dict(self.time_to_1_percent),
            "findings": [finding.as_json() for finding in self.findings],
            "diagnostics": [diagnostic.as_json() for diagnostic in self.diagnostics],
        }


@overload
def doctor(stage: None = None) -> tuple[MachineCheck, ...]: ...
@overload
def doctor(
    stage: str | os.PathLike[str] | Any,
    settings: RenderSettings = ...,
    *,
    pilot_seconds: float = ...,
    **values: Unpack[SettingsValues],
) -> Diagnosis: ...
@with_setting_names
def doctor(
    stage: str | os.PathLike[str] | Any | None = None,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    pilot_seconds: float = PILOT_S,
    **values: Unpack[SettingsValues],
) -> Diagnosis | tuple[MachineCheck, ...]:
    """Say why a stage, given as a Usd.Stage or as a path, comes out slow, grey, dark or empty, from `pilot_seconds` of
    rendering; without a stage, whether all that renders need works on this machine.

    >>> {check.name: check.works for check in primray.doctor()}["core"]
    True
    >>> findings = primray.doctor("shot.usda", resolution=(32, 18), pilot_seconds=0.1).findings
    >>> [finding.code for finding in findings if finding.question.value == "grey"]
    ['grey-as-authored']

    Fields of RenderSettings may be given by name; those that end a render are ignored. Errors are those of `render`.
    """
    if stage is None:
        from .machine import check_machine

        return check_machine()
    return diagnose(stage, with_values(settings, values), pilot_seconds)


def diagnose(stage: str | os.PathLike[str] | Any, settings: RenderSettings, pilot_seconds: float) -> Diagnosis:
    """Return the findings of a pilot render of some seconds; raise SettingsError where `pilot_seconds` is not positive."""
    from .. import usd
    from . import appearance, performance
    from .examination import examine

    check_pilot(pilot_seconds)
    open_ended = replace(settings, spp=None, time_limit_s=None, sample_range=None, target_error=SMALLEST_TARGET)
    seen = examine(stage, open_ended, pilot_seconds)
    camera, bounds = seen.prepared.camera, seen.prepared.scene.bounds
    width, height = seen.prepared.frame.size
    finders = (appearance.find_empty, appearance.find_dark, appearance.find_grey, performance.find_slow, performance.find_noise)
    named = os.fspath(stage) if isinstance(stage, str | os.PathLike) else usd.stage_name(stage)
    return Diagnosis(
        scene=named,
        camera=camera.path,
        resolution=(width, height),
        hit_share=seen.hit_share,
        grey_share=appearance.grey_share(seen),
        bounds=None if bounds is None else tuple(tuple(float(v) for v in corner) for corner in bounds),
        camera_position=tuple(float(v) for v in camera.world_from_camera[:3, 3]),
        meters_per_unit=seen.description.meters_per_unit,
        up_axis=seen.description.up_axis,
        lights=tuple((light.path, light.type.value) for light in seen.description.lights),
        set_up_s=performance.set_up_seconds(seen),
        speed=performance.speed(seen),
        counts=dict(seen.prepared.counts),
        time_to_1_percent=performance.time_to_error(seen),
        findings=tuple(finding for find in finders for finding in find(seen)),
        diagnostics=tuple(seen.diagnostics),
    )


def check_pilot(seconds: float) -> None:
    if not seconds > 0:
        raise SettingsError(f"the pilot must take more than 0 seconds, not {seconds}", where="pilot_seconds", code="pilot")


_PRIMS_SHOWN = 3
_TITLES = {
    "empty": "Why is something not there?",
    "dark": "Why is it dark, or bright?",
    "grey": "Why is it grey?",
    "slow": "Why is it slow?",
}


def lines(facts: dict[str, Any], verbose: bool) -> list[str]:
    """Return a few lines of figures, then the findings by question, then the remaining diagnostics of the stage."""
    told = [*_figures(facts)]
    for question, title in _TITLES.items():
        found = [finding for finding in facts["findings"] if finding["question"] == question]
        if found:
            told += ["", title]
            for finding in found:
                told += _finding(finding, verbose)
    if not facts["findings"]:
        told += ["", "Nothing was found that makes it slow, grey, dark or empty."]
    explained = {finding["code"] for finding in facts["findings"]}
    rest = [row for row in facts["diagnostics"] if row["code"] not in explained and (verbose or row["severity"] != "info")]
    if rest:
        told += ["", f"What else differs from the stage: {fidelity_text(rest)}", *diagnostics_lines(rest, verbose=verbose)]
    return told


def _figures(facts: dict[str, Any]) -> list[str]:
    from .performance import duration

    picture, speed, counts = facts["picture"], facts["speed"], facts["counts"]
    width, height = picture["resolution"]
    grey = "" if picture["grey_share"] is None else f", {picture['grey_share']:.0%} of that grey"
    took = facts["set_up_s"]
    steps = ", ".join(f"{name} {seconds:.2f}" for name, seconds in took.items())
    rows = [
        ("camera", f"{picture['camera'] or 'automatic'}, {width} x {height}"),
        ("sees", f"surfaces in {picture['hit_share']:.1%} of the picture{grey}"),
        ("lights", ", ".join(_kinds(picture["lights"])) or "none"),
        (
            "geometry",
            f"{counts['triangles_unique']:,} triangles, {counts['instances']:,} instances, {counts['textures']} textures",
        ),
        ("set-up", f"{sum(took.values()):.2f} s: {steps}"),
        ("speed", f"{speed['rays_per_s'] / 1e6:.2f} million rays/s, {speed['rays_per_sample']:.1f} rays a sample"),
        ("to 1 %", _to_one_percent(facts["time_to_1_percent"], duration)),
    ]
    return [f"{name:9} {text}" for name, text in rows]


def _kinds(lights: list[dict[str, str]]) -> list[str]:
    kinds = [light["type"] for light in lights]
    return [f"{kinds.count(kind):,} {kind}" for kind in dict.fromkeys(kinds)]


def _to_one_percent(found: dict[str, Any] | None, duration: Any) -> str:
    if found is None:
        return "unknown: no visible surface has an error"
    if found["seconds"] is None:
        return "more samples than are allowed"
    seconds, samples = found["seconds"], found["samples"]
    low, high = (duration(value) for value in seconds["ci95"])
    return f"about {duration(seconds['estimate'])} ({low} to {high}), {samples['estimate']:,.0f} samples a pixel"


def _finding(finding: dict[str, Any], verbose: bool) -> list[str]:
    shown = finding["prims"] if verbose else finding["prims"][:_PRIMS_SHOWN]
    shown = [path for path in shown if path]
    more = f" and {len(finding['prims']) - len(shown):,} more" if len(finding["prims"]) > len(shown) and shown else ""
    told = [f"  {finding['code']}: {finding['message']}"]
    told += [f"    at {', '.join(shown)}{more}"] if shown else []
    return [*told, f"    -> {finding['advice']}"]
