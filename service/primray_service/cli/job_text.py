"""Jobs as text: details of one, and a table of several."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from primray.diagnostic_codes import CODES
from primray.diagnostic_messages import diagnostics_lines

from .exits import error_of

if TYPE_CHECKING:
    from ..client import Job, Output, Progress, QueuePlace

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")


def plain(text: object) -> str:
    """Return text written by others without the characters that control a terminal."""
    return _CONTROL.sub("?", str(text))


def seconds_text(seconds: float) -> str:
    whole = round(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02d}:{whole % 60:02d}" if hours else f"{minutes}:{whole % 60:02d}"


def error_text(progress: Progress) -> str:
    """Return the error as text: "error 0.021 (0.019 to 0.023), target 0.01"."""
    error = progress.error
    if error is None or error.estimate is None:
        return ""
    interval = f" ({error.ci95[0]:.3g} to {error.ci95[1]:.3g})" if error.ci95 else ""
    target = f", target {error.target:.3g}" if error.target is not None else ""
    return f"{error.metric} {error.estimate:.3g}{interval}{target}"


def percent_text(progress: Progress) -> str:
    """Return the progress as a percentage, rounded down: "41%"; only finished jobs show 100%."""
    return f"{math.floor(100 * progress.fraction + 1e-9)}%"


def frames_text(progress: Progress) -> str:
    frames = progress.frames
    return f"{frames.succeeded}/{frames.total} frames" if frames is not None and frames.total > 1 else ""


def place_text(queue: QueuePlace | None) -> str:
    """Return the position in the queue as text: "place 2 of 5, starts in about 0:34"."""
    if queue is None or queue.place is None:
        return ""
    start_s = queue.estimated_start_s
    start = "start unknown" if start_s is None else f"starts in about {seconds_text(start_s)}" if start_s >= 1 else "starts now"
    return f"place {queue.place} of {queue.waiting}, {start}"


def state_text(job: Job) -> str:
    """Return the state as text: "failed: unknown-camera", with the renderer's code if the error is the renderer's."""
    return plain(job.state if job.error is None else f"{job.state}: {error_of(job.error).code}")


def block(job: Job, outputs: Sequence[Output]) -> list[str]:
    """Return the details of a job, one a line."""
    progress = job.progress
    running = [percent_text(progress), progress.phase or "", frames_text(progress), error_text(progress)]
    running.append(f"{seconds_text(progress.eta_s)} to go" if progress.eta_s and not job.is_terminal else "")
    lines = [
        ("job", job.id),
        ("name", job.name or ""),
        ("state", job.state + (f", attempt {job.attempt}" if job.attempt > 1 else "")),
        ("queue", place_text(job.queue)),
        ("progress", ", ".join(filter(None, running))),
        ("samples", f"{progress.samples_done:.0f} a pixel" if progress.samples_done else ""),
        ("scene", job.scene.id + (f", {job.scene.entry}" if job.scene.entry else "")),
        ("labels", " ".join(f"{name}={value}" for name, value in sorted(job.labels.items()))),
        ("priority", str(job.priority)),
        ("created", _time(job.created_at)),
        ("started", _time(job.started_at)),
        ("finished", _time(job.finished_at)),
        ("expires", _time(job.expires_at)),
        ("cpu", f"{job.usage['cpu_s']:.1f} s" if job.usage.get("cpu_s") else ""),
    ]
    if job.error is not None:
        lines.append(("error", str(error_of(job.error))))
    lines += [("output", f"{output.name}  {output.bytes:,} bytes") for output in outputs]
    return [f"{name:9} {plain(text)}" for name, text in lines if text] + warning_lines(job.warnings)


def warning_lines(warnings: Iterable[Mapping[str, object]]) -> list[str]:
    """Return the warnings as `primray render` words and groups them."""
    return [plain(line) for line in diagnostics_lines(map(_row_of, warnings))]


def print_warnings(warnings: Iterable[Mapping[str, object]]) -> None:
    for line in warning_lines(warnings):
        print(line, file=sys.stderr)


def _row_of(warning: Mapping[str, object]) -> dict[str, str]:
    """Return an API warning in the form of a report's diagnostics; what an old server leaves out comes from the table of
    codes."""
    code = str(warning.get("code", ""))
    known = CODES.get(code)
    severity = warning.get("severity") or (known.severity.value if known else "warning")
    return {
        "severity": str(severity) if severity in ("error", "warning", "info") else "warning",
        "kind": str(warning.get("kind") or (known.kind.value if known else "")),
        "code": code,
        "prim_path": str(warning.get("prim") or ""),
        "attribute": str(warning.get("attribute") or ""),
        "message": str(warning.get("detail", "")),
    }


def _time(moment: datetime | None) -> str:
    return "" if moment is None else moment.astimezone().strftime("%Y-%m-%d %H:%M:%S")


def table(jobs: Sequence[Job]) -> list[str]:
    """Return a table of jobs: a heading, then a line for each."""
    rows = [("JOB", "STATE", "DONE", "FRAMES", "ERROR", "TARGET", "ETA", "AGE", "NAME", "LABELS"), *map(_row, jobs)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _row(job: Job) -> tuple[str, ...]:
    progress, error, frames = job.progress, job.progress.error, job.progress.frames
    return (
        plain(job.id),
        state_text(job),
        percent_text(progress),
        f"{frames.succeeded}/{frames.total}" if frames else "",
        f"{error.estimate:.3g}" if error and error.estimate is not None else "",
        f"{error.target:.3g}" if error and error.target is not None else "",
        seconds_text(progress.eta_s) if progress.eta_s and not job.is_terminal else "",
        seconds_text((datetime.now(UTC) - job.created_at).total_seconds()),
        plain(job.name or ""),
        plain(" ".join(f"{name}={value}" for name, value in sorted(job.labels.items()))),
    )
