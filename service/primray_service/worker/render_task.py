"""One frame from its last checkpoint until it ends, gives way or is stopped, told as it goes.

primray's own machinery does the work (render.prepare, Sampling, Saver); here it is watched, paused and written down. What a
frame's pixels are does not depend on how often that happened.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from primray.checkpoints.checkpointing import Saver, begin
from primray.checkpoints.kept_beside import kept_beside
from primray.diagnostics import Diagnostics
from primray.render import Prepared, picture_of
from primray.report.report import Costs, settings_as_json
from primray.sampling.sampling import Sampling
from primray.settings import RenderSettings, settings_of_json

from ..problems import Problem
from ..sandbox import end_phase
from .channel import Channel
from .outputs import DEFAULT_NAMES, described, to_send, write_pictures, write_report
from .render_watch import Numbers, Phases, Warnings, Watch
from .stage_of_frames import StageOfFrames

REPORT_BYTES = 2**20


def render_frame(stages: StageOfFrames, command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    """Do it, and leave, or return if it is to stay; or raise what went wrong."""
    number = int(command.get("number") or 0)
    channel.nothing_to_save(number)
    phases, warned, costs, diagnostics = Phases(channel), Warnings(channel), Costs(), Diagnostics()
    costs.on_stage = phases
    prepared = _prepare(command, job, stages, costs, diagnostics)
    warned.send(diagnostics)
    files = command.get("outputs") or DEFAULT_NAMES
    check_view_of(files, prepared, bool(command.get("part")))
    with costs.stage("render"):
        sampling, about = begin(prepared, list(diagnostics), _checkpoint(command, job))
        sampling.count_as_spent(float(command.get("spent_s") or 0.0))
        channel.send("effective", **_effective(prepared, sampling))
        channel.nothing_to_save(None)
        channel.send("phase", phase="sampling")
        end_phase()
        numbers = Numbers(number, out)
        saver = Saver(about, float(command.get("checkpoint_every_s") or 60.0), numbers.next_file, numbers.send_to(channel))
        watch = Watch(sampling, saver, channel, out, shows=not command.get("part"))
        if command.get("preview"):
            channel.ask_preview()
        if command.get("picture_only"):
            sampling.run(lambda fraction, samples, rays: False)
        elif watch.run(float(command.get("fraction") or 0.0)) == "gave way":
            channel.leave("yielded", number=numbers.number)
        if command.get("keeps_beside") and sampling.film.samples:
            saver.wait()
            saver.keep_beside(kept_beside(prepared, sampling))
        watch.last_words()
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
    report = write_pictures(replace(image, metadata=channel.text.in_json(image.metadata)), files, out, diagnostics)
    saver.wait()
    report["checkpoint"] = saver.as_json() | {"file": f"checkpoint-{numbers.number}.prc"}
    if report["checkpoint"]["failed"]:
        diagnostics.add("checkpoint-unwritten", "", report["checkpoint"]["failed"])
    warned.send(diagnostics)
    report["diagnostics"] = [diagnostic.as_json() for diagnostic in diagnostics]
    write_report(channel.text.in_json(report), files, out)
    outputs = [described(out / file) for file in files if (out / file).exists()]
    channel.done(stay=bool(command.get("stay")), outputs=outputs, report=to_send(report, REPORT_BYTES))


def check_view_of(files: Sequence[str], prepared: Prepared, is_part: bool) -> None:
    """SettingsError before sampling where a PNG is to be written and the configuration cannot make its view."""
    if not is_part and any(file.endswith(".png") for file in files):
        from primray.images.exposure import View

        View(space=prepared.scene.rendering_space).check()


def _prepare(command: Mapping[str, Any], job: Path, stages: StageOfFrames, costs: Costs, diagnostics: Diagnostics) -> Prepared:
    settings = _settings(command)
    _limit_images(command.get("limits") or {})
    more_follow = bool(command.get("stay"))
    prepared = stages.prepare(str(job / command["file"]), settings, costs, diagnostics, more_follow=more_follow)
    return within_limits(prepared, command.get("limits") or {}, diagnostics)


# What a stage may ask for, and the limit of jobs that it is under.
LIMITED = {"spp": "samples", "time_limit_s": "seconds"}


def within_limits(prepared: Prepared, limits: Mapping[str, Any], diagnostics: Diagnostics) -> Prepared:
    """Return what is prepared, with no more samples and seconds asked for by the stage than a job could ask for."""
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


def _settings(command: Mapping[str, Any]) -> RenderSettings:
    values = dict(command["settings"])
    limits = command.get("limits") or {}
    if values.get("max_memory_bytes") is None and limits.get("memory_bytes") is not None:
        values["max_memory_bytes"] = int(limits["memory_bytes"])
    try:
        return settings_of_json(values)
    except (TypeError, ValueError) as error:
        raise Problem("settings-rejected", f"The settings make no sense: {error}.") from error


def _limit_images(limits: Mapping[str, Any]) -> None:
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
