"""The report of a render: its cost, its inputs and versions, and what it left out; as JSON, and for an image's header."""

from __future__ import annotations

import os
import resource
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ..installed_packages import version_of
from ..settings import BIAS, DEFAULT_FILTER_WIDTH, Metric, RenderSettings, settings_as_json
from ..time_spans import span
from ..version import __version__

if TYPE_CHECKING:
    from ..camera import Camera
    from ..color.color_space import ColorSpace
    from ..core import Film
    from ..description import SceneDescription
    from ..sampling.sampling import Sampling

STAGES = ("open", "translate", "dice", "build", "render", "write")


@dataclass
class Costs:
    """Wall-clock seconds of each stage, and CPU seconds (user and system, all threads) of the render stage."""

    stages_s: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    render_cpu_s: float = 0.0
    checkpoint: dict[str, Any] | None = None  # the report's entry on checkpoints, if any are written
    on_stage: Callable[[str], None] | None = None  # called as each stage begins

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        if self.on_stage is not None:
            self.on_stage(name)
        start, cpu = time.perf_counter(), cpu_seconds()
        try:
            with span(name):
                yield
        finally:
            self.stages_s[name] = self.stages_s.get(name, 0.0) + time.perf_counter() - start
            if name == "render":
                self.render_cpu_s += cpu_seconds() - cpu


def cpu_seconds() -> float:
    """Return user plus system time of this process so far."""
    times = os.times()
    return times.user + times.system


def peak_rss_bytes() -> int:
    """Return the peak resident memory of this process.

    VmHWM of proc(5) is preferred, because getrusage(2) includes the peak of the parent that started the process; ru_maxrss is
    the fallback (KiB, on macOS bytes).
    """
    try:
        with open("/proc/self/status", encoding="ascii", errors="replace") as file:
            return next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM:"))
    except (OSError, StopIteration):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak if sys.platform == "darwin" else peak * 1024


def usable_threads() -> int:
    """Return the number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def resolve_settings(settings: RenderSettings, description: SceneDescription) -> RenderSettings:
    """Return the settings with the choices of scene and machine filled in, so that the render can be repeated."""
    width, given = settings.filter_width, settings.camera
    return replace(
        settings,
        camera=given if given is not None and not isinstance(given, str) else description.camera.path or given,
        spp=settings.spp if settings.stops_early or settings.sample_range else settings.most_samples,
        resolution=description.resolution,
        resolution_scale=1.0,
        time_code=description.time_code,
        rendering_color_space=description.rendering_space.name,
        error_metric=settings.metric,
        denoise=settings.denoise is True,
        filter=settings.pixel_filter,
        motion_error=settings.most_motion_error,
        filter_width=width if width is not None else DEFAULT_FILTER_WIDTH[settings.pixel_filter],
        threads=settings.threads or usable_threads(),
    )


def package_versions() -> dict[str, str]:
    """Return versions of the packages that affect a picture, without importing any of them."""
    packages = {
        "usd": "usd-core",
        "embree": "embreex",
        "openimageio": "OpenImageIO",
        "ocio": "opencolorio",
    }
    versions = {"primray": __version__, "python": sys.version.split()[0]}
    for name, package in packages.items():
        versions[name] = version_of(package) or "not installed"
    return versions


def make_report(
    sampling: Sampling,
    costs: Costs,
    scene: Mapping[str, int],
    diagnostics: list[dict[str, str]],
    core: Mapping[str, Any],
    sha256: str,
    space: ColorSpace,
) -> dict[str, Any]:
    """Return the report of a render.

    `scene` are the scene's counts, `core` the core's facts about itself, `space` the colour space of the pixels. Errors and
    rays are per channel of that space; the display error is measured after the view.
    """
    render_s = costs.stages_s["render"]
    film, settings, stop = sampling.film, sampling.settings, sampling.stop
    assert stop is not None
    error = sampling.rows[-1].error.as_json() if sampling.rows else dict.fromkeys(metric.value for metric in Metric)
    optional = ({} if costs.checkpoint is None else {"checkpoint": costs.checkpoint}) | _left_out(film, settings, space)
    optional |= {"texture_memory": core["texture_memory"]} if "texture_memory" in core else {}
    return optional | {
        "stages_s": costs.stages_s,
        "samples": int(film.samples),
        "samples_per_pixel": [int(n) for n in film.samples_per_pixel],
        "rays": int(film.rays),
        "rays_by_kind": film.rays_by_kind,
        "splits": sampling.splits.paths,
        "light_samples": sampling.splits.lights,
        "lane_occupancy": sampling.lane_occupancy,
        "invalid_samples": film.invalid_samples,
        "error": error,
        "convergence": [row.as_json() for row in sampling.rows],
        "stop": stop.as_json(),
        "sampling_s": sampling.seconds,
        "rays_per_s": (film.rays - sampling.earlier_rays) / render_s if render_s > 0 else 0.0,
        "cpu_s": costs.render_cpu_s,
        "cpu_total_s": cpu_seconds(),
        "peak_rss_bytes": peak_rss_bytes(),
        "interrupted": stop.reason == "interrupted",
        "isa": core["isa"],
        "lanes": core["lanes"],
        "threads": settings.threads,
        "pixels_sha256": sha256,
        "color_space": {"name": space.name, **{k: list(getattr(space, k)) for k in ("red", "green", "blue", "white")}},
        "scene": dict(scene),
        "features": core["features"],
        "diagnostics": diagnostics,
        "settings": settings_as_json(settings),
        "versions": package_versions() | core["versions"],
    }


def _left_out(film: Film, settings: RenderSettings, space: ColorSpace) -> dict[str, Any]:
    """Return the light that was left out of the picture, if a setting asked for a bias."""
    if all(getattr(settings, name) == none for name, none in BIAS.items()):
        return {}
    from .picture_checks import left_out

    return {"left_out": left_out(film, settings, space)}


# Entries in which two renders of the same picture may differ; the rest goes into the image's header.
_COSTS = (
    "stages_s",
    "sampling_s",
    "convergence",
    "rays_per_s",
    "cpu_s",
    "cpu_total_s",
    "peak_rss_bytes",
    "pixels_sha256",
    "scene",
    "features",
    "texture_memory",
    "diagnostics",
    "checkpoint",
    "aovs",
    "labels",
)


def header_of(report: Mapping[str, Any]) -> dict[str, str | int | float]:
    """Return the report without its costs, as flat names with plain values ("settings.spp": 64)."""
    return dict(_flatten("", {name: value for name, value in report.items() if name not in _COSTS}))


def subject_of(stage: str, camera: Camera) -> dict[str, str | int | float]:
    """Return header entries for the subject of the picture: stage file, camera and lens. The frame is a setting."""
    says: dict[str, Any] = {"path": camera.path, "projection": camera.projection.value, "exposure_scale": camera.exposure_scale}
    says |= {"lens_radius": camera.lens_radius, "focus_distance": camera.focus_distance, "blades": camera.blades}
    says |= {"shutter": camera.shutter, "clipping_range": camera.clipping_range, "window": camera.window}
    return dict(_flatten("", {"stage": stage, "camera": says}))


def _flatten(prefix: str, value: Any) -> Iterator[tuple[str, str | int | float]]:
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _flatten(f"{prefix}.{name}" if prefix else name, inner)
    elif isinstance(value, list | tuple):
        yield prefix, " ".join(str(item) for item in value)
    elif value is None:
        yield prefix, "default"
    elif isinstance(value, bool):
        yield prefix, int(value)
    else:
        yield prefix, value if isinstance(value, str | int | float) else str(value)
