"""Reports of a running render to its server (phases, warnings, progress, rows of the error, previews, checkpoints), and its
commands to stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from primray.checkpoints.checkpointing import Saver
from primray.color.color_space import REC709, ColorSpace, matrix, transformed
from primray.diagnostics import Diagnostics
from primray.images.background import Backdrop
from primray.images.image import Image
from primray.sampling.prediction import Forecaster
from primray.sampling.sampling import Sampling
from primray.settings import SAMPLE_BLOCK

from .channel import Channel
from .preview import Values, preview_of, write_preview

PHASES = {
    "open": "opening",
    "translate": "translating",
    "dice": "building",
    "build": "building",
    "write": "writing",
}
PROGRESS_EVERY_S, PART_PROGRESS_EVERY_S = 0.5, 1.0  # parts report less often, since there are more of them
PREVIEW_EVERY_S = 0.5  # at most, and at most a tenth of the time
MOST_WARNINGS = 1000
# Seconds from the last sample to the end of all work: encoding the files, a second for 4 megapixels.
TAIL_S, TAIL_S_PER_PIXEL = 0.1, 2.5e-7


def passes_of(sampling: Sampling) -> int:
    """Return the number of sample blocks per pixel, on average: the same after a resume as before it."""
    return int(sampling.mean_samples() / SAMPLE_BLOCK)


def in_rec709(pixels: Values, errors: Values, space: ColorSpace) -> tuple[Values, Values]:
    """Return pixels and errors in Rec.709, the colour space of previews. Channels see the same paths, so their errors are added
    linearly, which is an upper bound."""
    by = matrix(space, REC709)
    if by is None:
        return pixels, errors
    return np.concatenate([transformed(pixels[..., :3], by), pixels[..., 3:]], axis=2), transformed(errors, np.abs(by))


class Phases:
    """Reports each phase once."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._last = ""

    def __call__(self, stage: str) -> None:
        phase = PHASES.get(stage, "")
        if phase and phase != self._last:
            self._last = phase
            self._channel.send("phase", phase=phase)


class Warnings:
    """Reports each diagnostic once; of very many the first ones, and the number of the others."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._sent = 0

    def send(self, diagnostics: Diagnostics) -> None:
        for found in list(diagnostics)[self._sent :]:
            self._sent += 1
            if self._sent <= MOST_WARNINGS:
                self._channel.send(
                    "warning",
                    code=found.code,
                    prim=found.prim_path[:1000],
                    detail=found.message[:1000],
                    severity=found.severity.value,
                    kind=found.kind.value,
                    attribute=found.attribute[:1000],
                )
        if self._sent > MOST_WARNINGS:
            more = f"{self._sent - MOST_WARNINGS} more warnings are in the report."
            self._channel.send(
                "warning", code="more-diagnostics", prim="", detail=more, severity="info", kind="note", attribute=""
            )


class Numbers:
    """Names of checkpoints: each replaces the previous one, which stays until the server has the new one."""

    def __init__(self, number: int, out: Path) -> None:
        self.number = number
        self._out = out

    def next_file(self) -> Path:
        return self._out / f"checkpoint-{self.number + 1}.prc"

    def send_to(self, channel: Channel) -> Callable[[Path, float, float], None]:
        def written(file: Path, samples: float, seconds: float) -> None:
            self.number += 1
            size = file.stat().st_size
            channel.send("checkpoint", number=self.number, file=file.name, bytes=size, samples=samples, seconds=seconds)

        return written


@dataclass(frozen=True)
class Share:
    """The watched render's share of a frame. Renders of several products run one after another."""

    place: int = 0
    renders: int = 1
    passes: int = 0  # of the previews before, which those of this render follow

    def fraction(self, own: float) -> float:
        return (self.place + own) / self.renders

    def own(self, fraction: float) -> float:
        """Return this render's own fraction from the frame's."""
        return min(max(fraction * self.renders - self.place, 0.0), 1.0)

    def left_s(self, own: float, whole: float) -> float:
        """Return the seconds left of the frame; each later render is assumed to take as long as this one."""
        return own + (self.renders - self.place - 1) * whole


class Watch:
    """Monitor of a render: progress, rows, previews, checkpoints, commands to stop. `shows`: whether previews and the error are
    reported, which parts do not. `backdrop` is behind the previews while it samples; `is_composited`: something is behind the
    picture of the files."""

    def __init__(
        self,
        sampling: Sampling,
        saver: Saver,
        channel: Channel,
        out: Path,
        *,
        shows: bool = True,
        share: Share = Share(),
        backdrop: Backdrop | None = None,
        is_composited: bool = False,
    ) -> None:
        self._share = share
        self._backdrop = backdrop
        self._is_composited = is_composited
        self._sampling = sampling
        self._saver = saver
        self._channel = channel
        self._out = out
        self._shows = shows
        width, height = sampling.scene.resolution
        self._pixels = width * height
        self._forecaster = Forecaster(sampling, TAIL_S + TAIL_S_PER_PIXEL * self._pixels)
        self._next_progress = 0.0
        self._rows = len(sampling.rows)
        self._shown = -1  # the pass of the last preview
        self._shown_samples = -1
        self._next_preview = 0.0
        self._start = time.perf_counter()
        self._first_rays = sampling.film.rays

    def run(self, fraction: float) -> str:
        """Sample until it ends, and return why: "stopped", or it "gave way". `fraction` was reached by earlier runs."""
        sampling = self._sampling
        sampling.most_fraction = min(max(fraction, 0.0), 0.99)
        sampling.schedule = replace(sampling.schedule, first_look=self._shows, is_part=not self._shows)
        sampling.on_pass = self._on_pass
        try:
            while not sampling.run(self._on_progress, self._is_paused):
                if self._channel.give_way and not self._channel.stop:
                    break
                if self._wants_preview():
                    self._preview()
                if self._saver.is_due():
                    self._saver.save_meanwhile(sampling)
        finally:
            self._saver.wait()
        if sampling.stop is None:
            self._saver.save(sampling)
            return "gave way"
        self._saver.save_meanwhile(sampling)  # saved while the picture is written
        return "stopped"

    def last_words(self) -> None:
        """Report the last rows, progress and preview of a complete picture."""
        self._send_rows()
        self._send_progress(1.0)
        if self._shows and self._sampling.film.samples != self._shown_samples:
            self._preview()

    def show(self, image: Image) -> int:
        """Preview the picture as its files show it if that differs from what was sampled; return the last preview's pass."""
        if self._shows and (self._is_composited or image.shown is not image):
            shown = image.shown
            self._send_preview(*in_rec709(shown.pixels, self._sampling.film.image()[1], image.color_space))
        return self._share.passes + self._shown

    def _on_progress(self, fraction: float, samples: int, rays: int) -> bool:
        now = time.monotonic()
        if now >= self._next_progress:
            self._next_progress = now + (PROGRESS_EVERY_S if self._shows else PART_PROGRESS_EVERY_S)
            self._send_rows()
            self._send_progress(fraction)
        return not self._channel.stop

    def _is_paused(self) -> bool:
        return self._channel.give_way or self._wants_preview() or self._saver.is_due()

    def _on_pass(self) -> None:
        if self._shows and self._shown < 0:
            self._preview()

    def _wants_preview(self) -> bool:
        """Return whether to send a preview: the first one as soon as every pixel has samples; a frame that resumes from a
        checkpoint may send one at once."""
        if not self._shows or time.monotonic() < self._next_preview or self._sampling.done == 0:
            return False
        return self._shown < 0 or (self._channel.wants_preview() and passes_of(self._sampling) > self._shown)

    def _preview(self) -> None:
        start = time.monotonic()
        pixels, errors = self._sampling.film.image()
        if self._backdrop is not None:
            pixels = self._backdrop.behind(pixels)
        self._send_preview(*in_rec709(pixels, errors, self._sampling.scene.rendering_space))
        took = time.monotonic() - start
        self._next_preview = time.monotonic() + max(PREVIEW_EVERY_S, 9 * took)

    def _send_preview(self, pixels: Values, errors: Values) -> None:
        """Send a preview; pixels and errors are in Rec.709."""
        number, samples = max(passes_of(self._sampling), self._shown + 1), self._sampling.film.samples
        preview = preview_of(pixels, errors, self._share.passes + number, samples)
        file, size = write_preview(preview, self._out)
        self._channel.send("preview", **{"pass": preview.passes, "file": file, "bytes": size, "samples": preview.samples})
        self._shown, self._shown_samples = number, samples

    def _send_rows(self) -> None:
        """Send rows of the convergence curve. Of several renders only the first has one: a frame has one curve."""
        rows = self._sampling.rows if self._share.place == 0 else []
        for row in rows[self._rows :]:
            found = row.as_json()
            if math.isfinite(row.error.relmse.high) and math.isfinite(row.error.rmse.high):
                self._channel.send("row", t_s=found.pop("seconds"), **found)
        self._rows = len(rows)

    def _send_progress(self, fraction: float) -> None:
        sampling, film = self._sampling, self._sampling.film
        forecast = self._forecaster.look()
        of_tiles = film.next.sum(axis=0)
        elapsed = max(sampling.now_s, sampling.seconds)
        ran = elapsed - self._forecaster.start_s
        ended = sampling.stop is not None
        left, share = None if ended else forecast.left_s, self._share
        error: dict[str, Any] | None = None
        if forecast.error is not None and math.isfinite(forecast.error.high):
            settings = sampling.settings
            ci95 = [forecast.error.low, forecast.error.high]
            error = {"metric": settings.metric.value, "estimate": forecast.error.value, "ci95": ci95}
            error |= {"target": settings.target_error, "kind": "estimated"}
        self._channel.send(
            "progress",
            fraction=share.fraction(fraction),
            samples_done=sampling.mean_samples(),
            samples_min=int(of_tiles.min()),
            samples_max=int(of_tiles.max()),
            rays=film.rays,
            rays_per_s=(film.rays - self._first_rays) / ran if ran > 0 else 0.0,
            elapsed_s=elapsed,
            error=error,
            eta_s=share.left_s(0.0, elapsed)
            if ended
            else None
            if left is None
            else share.left_s(left.value, elapsed + left.value),
            eta_ci95=None if left is None else [share.left_s(seconds, elapsed + seconds) for seconds in (left.low, left.high)],
            **{"pass": share.passes + passes_of(sampling)},
        )
