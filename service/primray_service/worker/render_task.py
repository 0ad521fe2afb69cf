"""One frame from its last checkpoint until it ends, is preempted or is stopped, with reports of its progress.

primray's own code does the work (render.prepare, Sampling, Saver); here it is monitored, paused and stored. A frame's pixels do
not depend on how often that happened. A worker that renders several frames of a job opens their stage once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from primray.checkpoints.aov_data import aov_data_of
from primray.checkpoints.checkpointing import Saver, begin
from primray.description.picture_file import PictureView
from primray.diagnostics import Diagnostics
from primray.images.background import behind_previews
from primray.incremental.scene import KeptStage
from primray.incremental.steps import KEPT_PART
from primray.process_memory import resident_bytes
from primray.render import Prepared, picture_of, prepare
from primray.render.prepare import OpenedStage, composing_settings
from primray.report.report import Costs
from primray.sampling.sampling import Sampling
from primray.settings import RenderSettings, files_of_jobs, settings_as_json, settings_of_json

from ..problems import Problem
from ..sandbox import end_phase
from .channel import Channel
from .outputs import DEFAULT_NAMES, PictureFiles, described, picture_files_of, to_send, write_pictures, write_report
from .render_watch import Numbers, Phases, Share, Warnings, Watch


class StageOfFrames:
    """The open stage. Create it before the stage is opened: memory in use by then, mostly libraries, does not count as the
    stage's."""

    def __init__(self) -> None:
        self._kept: KeptStage | None = None
        self._file = ""
        self._bytes_before = resident_bytes()

    def prepare(
        self, file: str, settings: RenderSettings, costs: Costs, diagnostics: Diagnostics, *, more_follow: bool
    ) -> Prepared:
        """Prepare a frame like render.prepare, for a checkpoint. Nothing is kept of the last frame beyond itself."""
        found, self._kept = self._kept, None
        if found is None or not self._has(found, file, settings):
            with costs.stage("open"):
                found = KeptStage(file, settings)
            if not more_follow:
                opened = found.opened
                return prepare(opened.stage, opened.diagnostics, settings, costs, diagnostics, fingerprinted=True)
        prepared = found.prepare(settings, costs, diagnostics, fingerprinted=True)
        if more_follow and self._is_small(settings.max_memory_bytes):
            self._kept, self._file = found, file
        return prepared

    def opened(self, file: str, settings: RenderSettings, costs: Costs) -> OpenedStage:
        """Return the stage, which the next `prepare` uses."""
        if self._kept is None or not self._has(self._kept, file, settings):
            self._kept = None
            with costs.stage("open"):
                self._kept, self._file = KeptStage(file, settings), file
        return self._kept.opened

    def _has(self, found: KeptStage, file: str, settings: RenderSettings) -> bool:
        return (self._file, found.opened.composed_by) == (file, composing_settings(settings))

    def _is_small(self, most_bytes: int | None) -> bool:
        return most_bytes is None or resident_bytes() - self._bytes_before <= KEPT_PART * most_bytes


REPORT_BYTES = 2**20


def render_frame(stages: StageOfFrames, command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    """Render a frame, and end the process, or return if it is to stay; raises errors."""
    number = int(command.get("number") or 0)
    channel.nothing_to_save(number)
    phases, warned, costs, diagnostics = Phases(channel), Warnings(channel), Costs(), Diagnostics()
    costs.on_stage = phases
    prepared = _prepare(command, job, stages, costs, diagnostics)
    warned.send(diagnostics)
    names, files = command.get("outputs") or DEFAULT_NAMES, picture_files_of(command)
    if not command.get("part"):
        check_view_of(names, files, prepared)
    numbers = Numbers(number, out)
    with costs.stage("render"):
        run = Run(prepared, command, diagnostics, channel, out, numbers, _checkpoint(command, job))
        if command.get("keeps_beside") and run.sampling.film.samples:
            run.saver.wait()
            run.saver.keep_beside(aov_data_of(prepared, run.sampling))
        run.watch.last_words()
    sampling, saver = run.sampling, run.saver
    if not sampling.film.samples:  # it was stopped before there was a picture
        saver.wait()
        channel.leave("done", outputs=[], report={"interrupted": True, "samples": 0})
    if command.get("part"):
        saver.wait()
        assert sampling.stop is not None
        said = {"stop": sampling.stop.as_json(), "samples": int(sampling.film.samples), "rays": int(sampling.film.rays)}
        return channel.done(stay=bool(command.get("stay")), outputs=[], report=said)
    phases("write")
    image = picture_of(prepared, sampling, costs, diagnostics)
    run.watch.show(image)
    image = replace(image, metadata=channel.text.in_json(image.metadata))
    report = write_pictures(image, names, out, diagnostics, files)
    saver.wait()
    report["checkpoint"] = saver.as_json() | {"file": f"checkpoint-{numbers.number}.prc"}
    if report["checkpoint"]["failed"]:
        diagnostics.add("checkpoint-unwritten", "", report["checkpoint"]["failed"])
    warned.send(diagnostics)
    report["diagnostics"] = [diagnostic.as_json() for diagnostic in diagnostics]
    write_report(channel.text.in_json(report), names, out)
    outputs = [described(out / file) for file in names if (out / file).exists()]
    channel.done(stay=bool(command.get("stay")), outputs=outputs, report=to_send(report, REPORT_BYTES))


class Run:
    """The sampling of one picture, from its checkpoint if there is one. Afterwards it has ended, or the process has ended to
    yield.

    `spent_s`: earlier seconds of it, which count towards its time limit.
    """

    def __init__(
        self,
        prepared: Prepared,
        command: Mapping[str, Any],
        diagnostics: Diagnostics,
        channel: Channel,
        out: Path,
        numbers: Numbers,
        checkpoint: Path | None,
        share: Share = Share(),  # noqa: B008 - immutable
        spent_s: float | None = None,
    ) -> None:
        self.sampling, about = begin(prepared, list(diagnostics), checkpoint)
        self.sampling.count_as_spent(float(command.get("spent_s") or 0.0) if spent_s is None else spent_s)
        if share.place == 0:
            channel.send("effective", **_effective(prepared, self.sampling))
        channel.nothing_to_save(None)
        channel.send("phase", phase="sampling")
        end_phase()
        every_s = float(command.get("checkpoint_every_s") or 60.0)
        self.saver = Saver(about, every_s, numbers.next_file, numbers.send_to(channel))
        shows, asked = not command.get("part"), prepared.settings.background
        self.watch = Watch(
            self.sampling,
            self.saver,
            channel,
            out,
            shows=shows,
            share=share,
            backdrop=behind_previews(asked, prepared.frame, prepared.scene.rendering_space) if shows else None,
            is_composited=asked is not None or prepared.ground_shadow is not None,
        )
        if command.get("preview"):
            channel.ask_preview()
        if command.get("picture_only"):
            self.sampling.run(lambda fraction, samples, rays: False)
        elif self.watch.run(share.own(float(command.get("fraction") or 0.0))) == "gave way":
            channel.leave("yielded", number=numbers.number)


def check_view_of(names: Sequence[str], files: PictureFiles, prepared: Prepared) -> None:
    """Raise SettingsError before sampling if a view is to be written and the configuration cannot make it."""
    from primray.images.exposure import View
    from primray.images.image import shows_view

    if any(shows_view(Path(name), files.encoding) for name in names):
        asked = PictureView() if prepared.file is None else prepared.file.view
        if files.view is not None or files.display is not None or files.look is not None:
            asked = PictureView(files.view, files.display, files.look)
        View(asked.view, asked.display, asked.look, prepared.scene.rendering_space).check()


def _prepare(command: Mapping[str, Any], job: Path, stages: StageOfFrames, costs: Costs, diagnostics: Diagnostics) -> Prepared:
    settings = settings_of(command, job)
    limit_images(command.get("limits") or {})
    more_follow = bool(command.get("stay"))
    prepared = stages.prepare(str(job / command["file"]), settings, costs, diagnostics, more_follow=more_follow)
    return within_limits(prepared, command.get("limits") or {}, diagnostics)


# Stop rules that a stage may set, and the limit of jobs that applies to each.
LIMITED = {"spp": "samples", "time_limit_s": "seconds"}


def within_limits(prepared: Prepared, limits: Mapping[str, Any], diagnostics: Diagnostics) -> Prepared:
    """Return the prepared scene with the stage's samples and seconds reduced to what a job may request."""
    for one in prepared.asked.asked:
        most = limits.get(LIMITED.get(one.name, ""))
        if most is not None and one.value > most:
            message = f"{one.attribute} = {one.value:g} is more than this server allows: {most:g} is used."
            diagnostics.add("render-settings-input", one.prim, message, one.attribute)
            prepared = replace(prepared, settings=replace(prepared.settings, **{one.name: most}))
    return prepared


def _checkpoint(command: Mapping[str, Any], job: Path) -> Path | None:
    name = command.get("checkpoint")
    return None if name is None else job / str(name)


def settings_of(command: Mapping[str, Any], job: Path) -> RenderSettings:
    """Return the command's settings, with its limits and with the paths of the package's images."""
    values = dict(command["settings"])
    limits = command.get("limits") or {}
    if values.get("max_memory_bytes") is None and limits.get("memory_bytes") is not None:
        values["max_memory_bytes"] = int(limits["memory_bytes"])
    for name in files_of_jobs(RenderSettings):
        values[name] = place_of_image(command, job, values.get(name))
    try:
        return settings_of_json(values)
    except (TypeError, ValueError) as error:
        raise Problem("settings-rejected", f"The settings are not valid: {error}.") from error


def place_of_image(command: Mapping[str, Any], job: Path, name: str | None) -> str | None:
    """Return the path of the package's file with this name; other values stay as they are."""
    return str(package_file(command, job, name) or name) if name else name


def package_file(command: Mapping[str, Any], job: Path, name: str) -> Path | None:
    """Return the package's (or the shared root's) file with this name, or None."""
    if command.get("root"):
        folder = Path(command["root"])
    else:
        *folders, _ = Path(command["file"]).parts
        folder = job / folders[0] if folders else job
    path = folder / name
    return path if path.is_file() else None


def limit_images(limits: Mapping[str, Any]) -> None:
    import OpenImageIO as oiio

    if limits.get("texture_bytes"):
        oiio.attribute("limits:imagesize_MB", max(1, int(limits["texture_bytes"]) >> 20))


def _effective(prepared: Prepared, sampling: Sampling) -> dict[str, Any]:
    return {
        "settings": settings_as_json(sampling.settings),
        "features": list(prepared.scene.features),
        "scene": dict(prepared.counts),
        "resolution": list(prepared.scene.resolution),
    }
