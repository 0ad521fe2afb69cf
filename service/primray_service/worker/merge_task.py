"""Merge of a frame's parts: their checkpoints become one, whose picture and error are reported. No stage is opened."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from primray.checkpoints.merge import Merged, merge
from primray.distributed.gather import merge_and_judge
from primray.images.background import behind_previews
from primray.settings import SAMPLE_BLOCK

from .channel import Channel
from .preview import preview_of, write_preview
from .render_task import place_of_image
from .render_watch import in_rec709


def merge_parts(command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    """Merge parts: leaves a checkpoint with all of their samples and a preview, and reports the error."""
    channel.send("phase", phase="opening")
    merged, judged = _merged([job / str(name) for name in command["parts"]], command)
    number = int(command["number"]) + 1
    file = out / f"merged-{number}.prc"  # not a name that parts use: the next of them may run here before this one is taken
    merged.save_checkpoint(file)
    report = merged.image.report
    samples, seconds = int(report["sample_ranges"][-1][1]), float(report["sampling_s"])
    size = file.stat().st_size
    channel.send("checkpoint", number=number, file=file.name, bytes=size, samples=float(samples), seconds=seconds)
    _send_preview(merged, samples, place_of_image(command, job, command.get("background")), out, channel)
    for row in report["convergence"][-1:]:
        if _is_known(row["ci95"]):
            channel.send("row", **{("t_s" if name == "seconds" else name): value for name, value in row.items()})
    error = _error_of(report["error"], command)
    found = {"ranges": report["sample_ranges"], "rays": int(report["rays"]), "error": error, "judged": judged}
    report = {"samples": int(report["samples"]), "parts": found}
    channel.done(stay=bool(command.get("stay")), outputs=[], report=report)


def _merged(paths: list[Path], command: Mapping[str, Any]) -> tuple[Merged, dict[str, Any] | None]:
    """Return the merged film, and the measured error if one was requested."""
    if command["target"] is None:
        return merge(paths), None
    asked = (command["most"], float(command["target"]), str(command["metric"]), command.get("mixes", ()))
    merged, found = merge_and_judge(paths, *asked)
    is_met = found.stop is not None and found.stop.reason == "target-error"
    return merged, {"target_met": is_met, "goal": found.goal, "expected": found.expected}


def _send_preview(merged: Merged, samples: int, background: str | None, out: Path, channel: Channel) -> None:
    image = merged.image
    if image.errors is None:
        return
    backdrop = None if image.frame is None else behind_previews(background, image.frame, image.color_space)
    pixels = image.pixels if backdrop is None else backdrop.behind(image.pixels)
    shown = in_rec709(pixels, image.errors, image.color_space)
    preview = preview_of(*shown, samples // SAMPLE_BLOCK, int(image.report["samples"]))
    file, size = write_preview(preview, out)
    channel.send("preview", **{"pass": preview.passes, "file": file, "bytes": size, "samples": preview.samples})


def _error_of(errors: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the error that a target applies to, in the requested metric, in the form of progress messages."""
    found = (errors.get("mix") or errors).get(command["metric"])
    if not found or not _is_known(found["ci95"]):
        return None
    error = {"metric": command["metric"], "estimate": found["estimate"], "ci95": found["ci95"], "target": command.get("target")}
    return error | {"kind": "estimated"}


def _is_known(interval: list[float]) -> bool:
    return all(math.isfinite(end) for end in interval)
