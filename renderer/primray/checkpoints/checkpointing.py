"""Rendering with a checkpoint file: started or resumed, saved at intervals during rendering, and at the end."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..aovs import has_deep
from ..errors import CheckpointError, PrimrayError, SettingsError
from ..settings.stage_settings import CHECKPOINT_EVERY

if TYPE_CHECKING:
    from ..diagnostics import Diagnostic
    from ..report.prepared import Prepared
    from ..sampling.sampling import Progress, Sampling, Saving
    from .aov_data import AovData
    from .checkpoint import CheckpointInfo

DEFAULT_EVERY_S = 60.0


@dataclass(frozen=True)
class Checkpointing:
    """File that a render's checkpoints are written to, at intervals and at the end, and the checkpoint that it resumes, if any.

    >>> saved = primray.Checkpointing("shot.prc", every_s=30)
    >>> image = primray.render("shot.usda", checkpointing=saved, resolution=(32, 18), spp=2)
    >>> more = primray.Checkpointing("shot.prc", resume="shot.prc")
    >>> primray.render("shot.usda", checkpointing=more, resolution=(32, 18), spp=4).report["samples_per_pixel"]
    [4, 4]

    Raises SettingsError for an interval that is not above 0; rendering raises CheckpointError if the checkpoint to resume is
    missing or of another render.
    """

    file: Path
    every_s: float | None = None  # None: the stage's interval, else 60
    resume: Path | None = None

    if TYPE_CHECKING:

        def __init__(
            self,
            file: str | os.PathLike[str],
            every_s: float | None = None,
            resume: str | os.PathLike[str] | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", Path(self.file))
        object.__setattr__(self, "resume", None if self.resume is None else Path(self.resume))
        if self.every_s is not None and not (math.isfinite(self.every_s) and self.every_s > 0):
            raise SettingsError(f"the interval of checkpoints must be a number of seconds above 0, not {self.every_s}")

    def check(self) -> None:
        """Raise an error, before rendering, for files that cannot be read or written; existing files are not overwritten."""
        from ..images.output_path import check_folder
        from . import checkpoint

        check_folder(self.file)
        if self.resume is not None:
            checkpoint.check(self.resume)
        if self.file.exists() and (self.resume is None or not os.path.samefile(self.file, self.resume)):
            raise CheckpointError(
                "the checkpoint exists already: resume it, or remove it", where=str(self.file), code="checkpoint-exists"
            )

    def run(
        self, prepared: Prepared, diagnostics: list[Diagnostic], progress: Progress, savings: Sequence[Saving] = ()
    ) -> tuple[Sampling, dict[str, Any]]:
        """Sample until a stopping rule applies, saving at intervals (`savings` too); also return the report's checkpoint
        facts."""
        from ..sampling.sampling import run_with_saving
        from .aov_data import aov_data_of

        sampling, about = begin(prepared, diagnostics, self.resume)
        resumed_at = sampling.mean_samples()
        every_s = self.every_s or prepared.asked.of(CHECKPOINT_EVERY) or DEFAULT_EVERY_S
        saver = Saver(about, every_s, lambda: self.file)
        try:
            run_with_saving(sampling, progress, (saver, *savings))
        finally:
            saver.wait()
        if prepared.settings.sample_range is not None and sampling.stop is not None and sampling.stop.reason != "interrupted":
            saver.keep_beside(aov_data_of(prepared, sampling))
        saver.save(sampling)
        return sampling, saver.as_json() | ({} if self.resume is None else {"resumed_at": resumed_at})


def begin(prepared: Prepared, diagnostics: list[Diagnostic], resume: Path | None) -> tuple[Sampling, CheckpointInfo]:
    """Return the sampling of a scene, resumed from a checkpoint if one is given, and the data of its checkpoints."""
    from ..denoising.denoised import denoised_target
    from ..description.picture_file import PLAIN
    from ..sampling.sampling import Sampling
    from ..settings import settings_as_json
    from . import checkpoint
    from .aov_data import light_paths_of_tables

    if has_deep(prepared.aovs):
        raise SettingsError(
            "a deep picture has no checkpoints, which services and frames in parts need: leave out --aov deep and deepRaster "
            "products, or render the frame in one go",
            where="aovs",
            code="deep-setting",
        )
    held = None if resume is None else checkpoint.load(resume)
    settings = prepared.settings if held is None else checkpoint.resumed_settings(prepared.settings, held)
    light_paths = light_paths_of_tables(prepared.aovs, prepared.scene.light_paths)
    asked = {} if light_paths is None else {"light_paths": " ".join(light_paths.expressions)}
    about = checkpoint.CheckpointInfo(
        identity=checkpoint.identity(settings, prepared.fingerprint) | asked,
        settings=settings_as_json(settings),
        camera=prepared.camera,
        frame=prepared.frame,
        counts=prepared.counts,
        features=list(prepared.scene.features),
        diagnostics=[diagnostic.as_json() for diagnostic in diagnostics],
        aovs=tuple(request.name for request in prepared.aovs),
        rendering_space=prepared.scene.rendering_space,
        motion=prepared.motion,
        stage=prepared.stage,
        light_paths=light_paths,
        file=prepared.file or PLAIN,
    )
    if held is None:
        sampling = Sampling.begin(prepared.scene, settings)
    else:
        sampling = checkpoint.resume(prepared.scene, settings, about, held)
    sampling.schedule = replace(sampling.schedule, resumable=True)
    sampling.judge_by, sampling.mixes = denoised_target(prepared.scene, settings), prepared.mixes
    return sampling, replace(about, features=list(prepared.scene.features))


class Saver:
    """Writes checkpoints, one at a time, from copies in a thread, so that rendering need not wait for the disk.

    `name` returns the file of the next one; `written` is called for each (file, samples per pixel, seconds of sampling), in the
    thread that wrote it. A render does not fail because a checkpoint cannot be written; the report shows the error.
    """

    def __init__(
        self,
        about: CheckpointInfo,
        every_s: float,
        name: Callable[[], Path],
        written: Callable[[Path, float, float], None] | None = None,
    ) -> None:
        self._name = name
        self._on_written = written
        self._file = Path()
        self._every_s = every_s
        self._about = about
        self._thread: threading.Thread | None = None
        self._next = time.monotonic() + self._every_s
        self._written = 0
        self._paused_s = 0.0
        self._write_s = 0.0
        self._failed: str | None = None

    def is_due(self) -> bool:
        return time.monotonic() >= self._next and (self._thread is None or not self._thread.is_alive())

    def save_meanwhile(self, sampling: Sampling) -> None:
        from .checkpoint import contents

        start = time.perf_counter()
        copy = contents(sampling, self._about)
        work = (*copy, sampling.mean_samples(), sampling.seconds)
        self._thread = threading.Thread(target=self._write, args=work, name="checkpoint")
        self._thread.start()
        self._paused_s += time.perf_counter() - start
        self._next = time.monotonic() + self._every_s

    def keep_beside(self, kept: AovData | None) -> None:
        """Include this data for AOVs in checkpoints written from now on."""
        self._about = replace(self._about, beside=kept)

    def save(self, sampling: Sampling) -> None:
        from .checkpoint import contents

        start = time.perf_counter()
        self._write(*contents(sampling, self._about), sampling.mean_samples(), sampling.seconds)
        self._paused_s += time.perf_counter() - start

    def wait(self) -> None:
        if self._thread is not None:
            self._thread.join()

    def _write(self, header: dict[str, Any], arrays: dict[str, Any], samples: float, seconds: float) -> None:
        from .checkpoint_file import write_checkpoint

        start = time.perf_counter()
        self._file = self._name()
        try:
            write_checkpoint(self._file, header, arrays)
            self._written, self._failed = self._written + 1, None
            if self._on_written is not None:
                self._on_written(self._file, samples, seconds)
        except PrimrayError as error:
            self._failed = str(error)
        self._write_s += time.perf_counter() - start

    def as_json(self) -> dict[str, Any]:
        """Return the report's facts.

        `paused_s`: time that rendering waited; `write_s`: total time of writing; `failed`: why the last write failed.
        """
        return {
            "file": str(self._file),
            "written": self._written,
            "paused_s": self._paused_s,
            "write_s": self._write_s,
            "failed": self._failed,
        }
