"""Sums over a job's frames while they run and at the end: its progress, warnings, usage and result. Pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

from ...jobs import FRAME_TERMINAL, Frame, FrameState, Job, Json

MOST_WARNINGS = 500
NEARLY_DONE = 0.99  # progress of a frame whose samples are all taken, but whose picture is not there yet
MOST_DIGESTS = 256  # frames whose digests a job's result lists; each frame's own result has them anyway
METRICS = ("relmse", "rmse", "display")
# Ends from best to worst: a job's is the worst of its frames'.
STOPS = ("target-error", "samples", "time-limit", "interrupted")


@dataclass
class FrameTotals:
    """One frame's share; `seconds` is its total time, known at its end."""

    state: FrameState
    progress: Json = field(default_factory=dict)
    phase: str = ""
    result: Json | None = None
    error: Json | None = None
    cpu_s: float = 0.0
    peak_rss_bytes: int = 0

    @property
    def fraction(self) -> float:
        """Return the fraction that is done; 1 only for a frame that succeeded, not for one that was canceled or failed."""
        found = float(self.progress.get("fraction", 0.0))
        return 1.0 if self.state is FrameState.SUCCEEDED else min(found, NEARLY_DONE)

    @property
    def sampling_s(self) -> float:
        return float(self.progress.get("elapsed_s", 0.0))

    @property
    def whole_s(self) -> float:
        """Return the duration of a finished frame, including reading the scene and writing the picture."""
        stages = (self.result or {}).get("stages_s") or {}
        return max(float(sum(stages.values())), self.sampling_s)


class JobTotals:
    """Sums over one attempt of a job."""

    def __init__(self, job: Job, frames: Iterable[Frame]) -> None:
        self.job_id, self.attempt = job.id, job.attempt
        self._frames: dict[int, FrameTotals] = {}
        self._running: set[int] = set()
        for frame in frames:
            self.set(frame)
        self._fraction = float(job.progress.get("fraction", 0.0))
        self._warnings: dict[tuple[str, ...], Json] = {}
        self._left_out = 0
        self.add_warnings(job.warnings)

    def set(self, frame: Frame) -> None:
        self._frames[frame.number] = FrameTotals(
            state=frame.state,
            progress=frame.progress,
            phase=frame.phase,
            result=frame.result,
            error=frame.error,
            cpu_s=frame.cpu_s,
            peak_rss_bytes=frame.peak_rss_bytes,
        )
        if frame.state is FrameState.RUNNING:
            self._running.add(frame.number)
        else:
            self._running.discard(frame.number)

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def is_over(self) -> bool:
        return all(frame.state in FRAME_TERMINAL for frame in self._frames.values())

    def add_warnings(self, warnings: Iterable[Json]) -> list[Json]:
        """Add warnings and return the new ones: the same warning about a prim from several frames counts once."""
        new = []
        for warning in warnings:
            key = tuple(str(warning.get(name, "")) for name in ("code", "prim", "attribute", "detail"))
            if key in self._warnings:
                continue
            if len(self._warnings) >= MOST_WARNINGS:
                self._left_out += 1
                continue
            self._warnings[key] = warning
            new.append(warning)
        return new

    @property
    def warnings(self) -> list[Json]:
        listed = list(self._warnings.values())
        if self._left_out:
            sentence = f"{self._left_out} more warnings are omitted here; see the frames' reports."
            listed.append({"code": "more-warnings", "prim": "", "detail": sentence})
        return listed

    def progress(self, now: float) -> Json:
        counts, sums = self._added_up()
        running = [self._frames[number] for number in sorted(self._running)]
        shown = self._shown(running)
        self._fraction = min(max(self._fraction, sums["fraction"] / max(len(self), 1)), 1.0)
        eta_s, eta_ci95 = self._eta(running, counts)
        of_shown = {name: shown.progress.get(name) or 0 for name in ("samples_done", "samples_min", "samples_max", "pass")}
        of_shown["error"] = shown.progress.get("error")
        waits = counts[FrameState.QUEUED] > 0
        return of_shown | {
            "fraction": self._fraction,
            "phase": next((frame.phase for frame in running if frame.phase), "queued" if waits or running else ""),
            "frames": {"total": len(self)} | {state.value: counts[state] for state in FrameState},
            "rays": int(sums["rays"]),
            "rays_per_s": sum(frame.progress.get("rays_per_s") or 0.0 for frame in running),
            "elapsed_s": sums["elapsed_s"],
            "eta_s": eta_s,
            "eta_ci95": eta_ci95,
            "updated_at": datetime.fromtimestamp(now, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        }

    def _added_up(self) -> tuple[Counter[FrameState], Counter[str]]:
        """Return the number of frames by state, and sums over them, in one pass, since a job may have 10,000."""
        counts: Counter[FrameState] = Counter()
        fraction, rays, elapsed_s = 0.0, 0, 0.0
        for frame in self._frames.values():
            counts[frame.state] += 1
            if frame.progress:
                fraction += frame.fraction
                rays += frame.progress.get("rays") or 0
                elapsed_s += frame.sampling_s
            elif frame.state is FrameState.SUCCEEDED:
                fraction += 1.0
        return counts, Counter({"fraction": fraction, "rays": rays, "elapsed_s": elapsed_s})

    def _shown(self, running: Sequence[FrameTotals]) -> FrameTotals:
        """Return the frame whose samples and error represent the job: the first running one, else the one with the largest
        error."""
        known = [frame for frame in running if frame.progress.get("error")] or running
        return known[0] if known else max(self._frames.values(), key=_size_of_error, default=FrameTotals(FrameState.QUEUED))

    def _eta(self, running: Sequence[FrameTotals], counts: Mapping[FrameState, int]) -> tuple[float | None, list[float] | None]:
        """Return the seconds until the job is done, and their interval: queued frames are assumed to take as long as ended
        ones, or as running ones will; as many run concurrently as now."""
        waits = counts[FrameState.QUEUED] > 0
        if not running:
            return (None, None) if waits else (0.0, [0.0, 0.0])
        if any(frame.progress.get("eta_s") is None for frame in running):
            return None, None
        left = [float(frame.progress["eta_s"]) for frame in running]
        if not waits:
            slowest = max(running, key=lambda frame: float(frame.progress["eta_s"]))
            interval = slowest.progress.get("eta_ci95")
            return max(left), None if interval is None else [float(interval[0]), float(interval[1])]
        whole = [frame.whole_s for frame in self._frames.values() if frame.state is FrameState.SUCCEEDED]
        whole = whole or [frame.sampling_s + eta for frame, eta in zip(running, left, strict=True)]
        each = sum(whole) / len(whole)
        waiting = (frame for frame in self._frames.values() if frame.state is FrameState.QUEUED)
        eta = (sum(left) + sum(max(each - frame.sampling_s, 0.0) for frame in waiting)) / len(running)
        width = _spread(running, left)
        return eta, None if width is None else [eta * (1 - width[0]), eta * (1 + width[1])]

    def usage(self) -> Json:
        frames = self._frames.values()
        return {
            "cpu_s": sum(frame.cpu_s for frame in frames),
            "peak_rss_bytes": max((frame.peak_rss_bytes for frame in frames), default=0),
        }

    def first_error(self) -> Json | None:
        """Return the problem of the first failed frame, with its number if the job has several."""
        for number in sorted(self._frames):
            error = self._frames[number].error
            if self._frames[number].state is FrameState.FAILED and error is not None:
                return {**error, "attempt": self.attempt} | ({"frame": number} if len(self) > 1 else {})
        return None

    def cancel_waiting(self) -> None:
        """Cancel queued frames, since the job is being canceled."""
        for frame in self._frames.values():
            if frame.state is FrameState.QUEUED:
                frame.state = FrameState.CANCELED

    def result(self) -> Json | None:
        """Return the job's result; None if no frame made a picture."""
        made = {n: r for n in sorted(self._frames) if (r := self._frames[n].result) is not None and r.get("stop")}
        if not made:
            return None
        results = list(made.values())
        found: Json = {
            "stop": _stop_of(results),
            "error": _largest(r.get("error") for r in results),
            "samples": sum(r.get("samples") or 0 for r in results),
            "rays": sum(r.get("rays") or 0 for r in results),
            "stages_s": _sums(r.get("stages_s") or {} for r in results),
            "sampling_s": sum(r.get("sampling_s") or 0.0 for r in results),
            "outputs": sum(len(r.get("outputs") or ()) for r in results),
        }
        if denoised := _largest(r.get("denoised") for r in results):
            found["denoised"] = denoised
        if len(made) <= MOST_DIGESTS:
            found["pixels_sha256"] = [{"frame": n, "sha256": r.get("pixels_sha256")} for n, r in made.items()]
        return found


def _largest(errors: Iterable[Json | None]) -> Json | None:
    return max((error for error in errors if error), key=lambda error: float(error["estimate"]), default=None)


def _size_of_error(frame: FrameTotals) -> float:
    error = frame.progress.get("error")
    return -1.0 if not error else float(error["estimate"])


def _spread(running: Sequence[FrameTotals], left: Sequence[float]) -> tuple[float, float] | None:
    """Return how far the interval of the seconds left extends below and above, as fractions; that of the widest."""
    found = []
    for frame, eta in zip(running, left, strict=True):
        interval = frame.progress.get("eta_ci95")
        if interval is None:
            return None
        if eta > 0:
            found.append((min(max(1 - interval[0] / eta, 0.0), 1.0), max(interval[1] / eta - 1, 0.0)))
    return (max(low for low, _ in found), max(high for _, high in found)) if found else (0.0, 0.0)


def _stop_of(results: Sequence[Json]) -> Json:
    stops = [r["stop"] for r in results]
    reasons = [stop["reason"] for stop in stops]
    met = [stop["target_met"] for stop in stops if stop.get("target_met") is not None]
    return {"reason": max(reasons, key=STOPS.index), "target_met": all(met) if met else None}


def _sums(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    found: dict[str, float] = {}
    for row in rows:
        for name, value in row.items():
            found[name] = found.get(name, 0.0) + value
    return found


def frame_result(report: Mapping[str, object], stop: Json, job: Job, outputs: Sequence[str]) -> Json:
    """Return the part of the worker's report that a frame's row keeps."""
    followed = report.get("settings")
    followed = followed if isinstance(followed, Mapping) else {}  # the job's rules, and the stage's where those are open
    asked = job.settings.get("stop", {})
    measured = followed.get("error_metric")
    metric = asked.get("metric") or (measured if measured in METRICS else METRICS[0])
    of_denoised = job.settings.get("stop_at") == "denoised"
    target = asked.get("target_error") or _number(followed.get("target_error"))
    error = _error_of(report, metric, None if of_denoised else target)
    made = report.get("denoised")
    denoised = _error_of(made, metric, target if of_denoised else None) if isinstance(made, Mapping) else None
    kept = ("samples", "rays", "stages_s", "sampling_s", "pixels_sha256", "invalid_samples", "versions", "isa", "threads")
    beside = {} if denoised is None else {"denoised": denoised}
    return {"stop": stop, "error": error} | beside | {name: report.get(name) for name in kept} | {"outputs": list(outputs)}


def _number(found: object) -> float | None:
    return float(found) if isinstance(found, int | float) and math.isfinite(found) else None


def _error_of(says: Mapping[str, object], metric: str, target: float | None) -> Json | None:
    errors = says.get("error")
    errors = errors.get("mix") or errors if isinstance(errors, Mapping) else None
    measured = errors.get(metric) if isinstance(errors, Mapping) else None
    if not isinstance(measured, Mapping) or measured.get("estimate") is None:
        return None
    found = {"metric": metric, "estimate": measured["estimate"], "ci95": measured.get("ci95"), "target": target}
    return found | {"kind": "estimated"}


def target_warning(frame: Frame, result: Json, frames: int) -> Json | None:
    """Return a warning if a frame ended above its target error."""
    stop, error = result["stop"], result["error"]
    if stop.get("target_met") is not False or stop["reason"] == "interrupted":
        return None
    which = f"Frame {frame.number}" if frames > 1 else "It"
    ended = {"samples": "the sample limit was reached", "time-limit": "the time limit was reached"}.get(
        stop["reason"], "it ended"
    )
    reached = "" if error is None else f" at an error of {error['estimate']:.3g}"
    wanted = "" if error is None or error["target"] is None else f", above the target {error['target']:g}"
    return {
        "code": "target-not-met",
        "prim": "",
        "detail": f"{which} stopped{reached}{wanted}: {ended}.",
        "severity": "warning",
    }
