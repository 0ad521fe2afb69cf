"""A frame of several products: products with equal settings share a render, and renders run one after another.

A frame's checkpoint is a zip of its renders' own checkpoints, so that a worker that dies or is preempted loses no finished
render, and so that each of them can take more samples later.
"""

from __future__ import annotations

import json
import re
import time
import unicodedata
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from primray.diagnostics import Diagnostic, Diagnostics
from primray.errors import SettingsError
from primray.render import picture_of
from primray.render.frames import frame_name
from primray.render.products import Product, products_of, renders_of
from primray.report.report import Costs
from primray.settings import RenderSettings

from ..problems import Problem
from .channel import Channel
from .outputs import described, picture_files_of, to_send, write_picture, write_report
from .render_task import REPORT_BYTES, Run, StageOfFrames, check_view_of, limit_images, settings_of, within_limits
from .render_watch import Numbers, Phases, Share, Warnings

MOST_PRODUCTS = 60  # per frame, each a file
SPENT = "spent.json"  # in a checkpoint: seconds of sampling of each render


def render_products(stages: StageOfFrames, command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
    """Render the products, and end the process, or return if it is to stay; raises errors."""
    number = int(command.get("number") or 0)
    channel.nothing_to_save(number)
    frame = _Frame(stages, command, job, out, channel, Checkpoints(number, out))
    if command.get("checkpoint") is not None:
        frame.numbers.take(job / str(command["checkpoint"]))
    made = frame.run()
    if not made:
        channel.leave("done", outputs=[], report={"interrupted": True, "samples": 0})
    reports = [report for report, _ in made]
    report = reports[0] if len(reports) == 1 else joined(reports, command)
    whole = report if len(reports) == 1 else {"renders": reports}
    write_report(channel.text.in_json(whole), command["outputs"], out)
    names = [*(name for _, files in made for name in files), *command["outputs"]]
    outputs = [described(out / name) for name in names if (out / name).exists()]
    frame.numbers.remove()
    channel.done(stay=bool(command.get("stay")), outputs=outputs, report=to_send(report, REPORT_BYTES))


class Checkpoints(Numbers):
    """Checkpoints that hold those of all renders begun so far; `place` is the index of the running render."""

    def __init__(self, number: int, out: Path) -> None:
        super().__init__(number, out)
        self.place = 0
        self.spent_s: dict[int, float] = {}
        self.began: float | None = None
        self._files: dict[int, Path] = {}

    def take(self, packed: Path) -> None:
        """Unpack the checkpoints of an earlier run."""
        with zipfile.ZipFile(packed) as archive:
            self.spent_s = {int(place): float(spent) for place, spent in json.loads(archive.read(SPENT)).items()}
            for name in archive.namelist():
                if name != SPENT:
                    place = int(Path(name).stem)
                    self._files[place] = self._out / f"render-{place}.prc"
                    self._files[place].write_bytes(archive.read(name))

    def file(self, place: int) -> Path | None:
        return self._files.get(place)

    def next_file(self) -> Path:
        return self._out / f"render-{self.place}.next"

    def send_to(self, channel: Channel) -> Callable[[Path, float, float], None]:
        send, place, began, before = super().send_to(channel), self.place, time.monotonic(), self.spent_s.get(self.place, 0.0)

        def written(file: Path, samples: float, seconds: float) -> None:
            self._files[place] = file.replace(self._out / f"render-{place}.prc")
            self.spent_s[place] = before + time.monotonic() - began
            packed = super(Checkpoints, self).next_file()
            with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
                archive.writestr(SPENT, json.dumps(self.spent_s))
                for each, held in self._files.items():
                    archive.write(held, f"{each}.prc")
            send(packed, samples, seconds)

        return written

    def remove(self) -> None:
        """Remove the renders' own files, which the packed ones hold."""
        for file in self._files.values():
            file.unlink(missing_ok=True)


class _Frame:
    """The renders of a frame, one after another."""

    def __init__(
        self,
        stages: StageOfFrames,
        command: Mapping[str, Any],
        job: Path,
        out: Path,
        channel: Channel,
        numbers: Checkpoints,
    ) -> None:
        self.numbers = numbers
        self._stages, self._command, self._job, self._out, self._channel = stages, command, job, out, channel
        self._phases, self._warned = Phases(channel), Warnings(channel)
        self._warnings = Diagnostics()
        self._known: set[Diagnostic] = set()
        self._passes = 0
        self._files = picture_files_of(command)
        self._is_new_attempt = not command.get("spent_s")

    def run(self) -> list[tuple[dict[str, Any], list[str]]]:
        """Return the report of each render that has a picture, and the files that it wrote."""
        settings = settings_of(self._command, self._job)
        limit_images(self._command.get("limits") or {})
        renders, names = self._renders(settings)
        made = []
        for place, (own, products) in enumerate(renders):
            found = self._render(place, len(renders), own, products, names)
            if found is None:
                self._warn_of_missing(products)
            else:
                made.append(found)
        return made

    def _renders(self, settings: RenderSettings) -> tuple[list[tuple[RenderSettings, list[Product]]], dict[str, str]]:
        """Return the settings of each render with its products, and the products' file names by path."""
        asked = self._command["products"]
        costs = Costs()
        costs.on_stage = self._phases
        opened = self._stages.opened(str(self._job / self._command["file"]), settings, costs)
        try:
            products = products_of(opened, settings, asked["named"])
        except SettingsError as error:
            raise Problem("settings-rejected", error.message, member="settings.products", code=error.code) from None
        if len(products) > MOST_PRODUCTS:
            sentence = f"The render settings have {len(products)} products; {MOST_PRODUCTS} are allowed."
            raise Problem("limit-exceeded", sentence, member="settings.products", limit=MOST_PRODUCTS)
        names = names_within_job([p.file_name for p in products], settings.time_code, asked["name_end"])
        renders = renders_of(products)
        if settings.time_limit_s is not None:  # which is a frame's
            renders = [(replace(own, time_limit_s=settings.time_limit_s / len(renders)), ps) for own, ps in renders]
        return renders, {product.path: name for product, name in zip(products, names, strict=True)}

    def _render(
        self, place: int, renders: int, own: RenderSettings, products: Sequence[Product], names: Mapping[str, str]
    ) -> tuple[dict[str, Any], list[str]] | None:
        """Render; None if it was stopped before there was a picture."""
        checkpoint, numbers = self.numbers.file(place), self.numbers
        if checkpoint is None and (self._channel.stop or self._command.get("picture_only")):
            return None
        numbers.place = place
        if self._is_new_attempt:
            numbers.spent_s[place] = 0.0
        costs, diagnostics = Costs(), Diagnostics()
        costs.on_stage = self._phases
        more_follow = place + 1 < renders or bool(self._command.get("stay"))
        file = str(self._job / self._command["file"])
        prepared = self._stages.prepare(file, own, costs, diagnostics, more_follow=more_follow)
        prepared = within_limits(prepared, self._command.get("limits") or {}, diagnostics)
        files = [names[product.path] for product in products]
        check_view_of(files, self._files, prepared)
        self._tell(diagnostics)
        share = Share(place, renders, self._passes)
        with costs.stage("render"):
            spent_s = numbers.spent_s.get(place, 0.0)
            run = Run(prepared, self._command, diagnostics, self._channel, self._out, numbers, checkpoint, share, spent_s)
            run.watch.last_words()
        run.saver.wait()
        self._channel.nothing_to_save(numbers.number)
        if not run.sampling.film.samples:
            return None
        self._phases("write")
        image = picture_of(prepared, run.sampling, costs, diagnostics)
        self._passes = run.watch.show(image) + 1
        image = replace(image, metadata=self._channel.text.in_json(image.metadata))
        start = time.perf_counter()
        for product, name in zip(products, files, strict=True):
            write_picture(product.image_of(image), self._out / name, diagnostics, self._files)
        report = {**image.report, "outputs": files, "products": [product.path for product in products]}
        report["stages_s"] = {**image.report["stages_s"], "write": time.perf_counter() - start}
        report["checkpoint"] = run.saver.as_json() | {"file": f"checkpoint-{numbers.number}.prc"}
        if report["checkpoint"]["failed"]:
            diagnostics.add("checkpoint-unwritten", "", report["checkpoint"]["failed"])
        self._tell([*diagnostics, *(note for product in products for note in product.notes)])
        report["diagnostics"] = [diagnostic.as_json() for diagnostic in diagnostics]
        return report, files

    def _tell(self, diagnostics: Sequence[Diagnostic] | Diagnostics) -> None:
        """Report diagnostics that no earlier render has reported."""
        new = [diagnostic for diagnostic in diagnostics if diagnostic not in self._known]
        self._known.update(new)
        self._warnings.extend(new)
        self._warned.send(self._warnings)

    def _warn_of_missing(self, products: Sequence[Product]) -> None:
        listed = ", ".join(product.path for product in products)
        self._channel.send(
            "warning",
            code="product-not-rendered",
            prim=products[0].path[:1000],
            detail=f"The frame was stopped before these products were rendered: {listed}."[:1000],
            severity="warning",
            kind="missing",
            attribute="",
        )


def joined(reports: Sequence[Mapping[str, Any]], command: Mapping[str, Any]) -> dict[str, Any]:
    """Return one report of several renders: their sums, the largest error, and the stop that was furthest from its goal."""
    metric = str(command["settings"].get("error_metric") or "relmse")
    first, worst = reports[0], max(reports, key=lambda report: _estimate(report, metric))
    stops = [report["stop"] for report in reports]
    stop = next((s for s in stops if s.get("reason") == "interrupted"), None) or worst["stop"]
    met = [s["target_met"] for s in stops if s.get("target_met") is not None]
    sums = {name: sum(report.get(name) or 0 for report in reports) for name in ("samples", "rays", "sampling_s")}
    stages_s: dict[str, float] = {}
    for report in reports:
        for name, seconds in report["stages_s"].items():
            stages_s[name] = stages_s.get(name, 0.0) + seconds
    return {
        **{name: value for name, value in first.items() if name not in ("pixels_sha256", "outputs", "products", "denoised")},
        **{name: worst[name] for name in ("error", "denoised") if name in worst},
        **sums,
        "stages_s": stages_s,
        "stop": {**stop, "target_met": all(met) if met else None},
        "diagnostics": [row for report in reports for row in report["diagnostics"]],
    }


def _estimate(report: Mapping[str, Any], metric: str) -> float:
    found = (report.get("error") or {}).get(metric) or {}
    return float(found.get("estimate") or 0.0)


LONGEST = 60  # characters of a stem, which the frame's suffix follows, and a number if two are equal


def names_within_job(files: Sequence[str], time_code: float | None, end: str) -> list[str]:
    """Return a name for each product's file of a frame, from the paths in productName.

    Folders are dropped, unless two files differ in them alone. `end` comes before the extension; if a name has its own
    placeholder for the frame's number, the number is not repeated. SettingsError if there is such a placeholder and no frame.
    """
    own = [_at_frame(file, time_code) for file in files]
    plain = [PurePosixPath(file).name.casefold() for file in own]
    names: list[str] = []
    for file, name in zip(own, plain, strict=True):
        path = PurePosixPath(file)
        parts = path.parts if plain.count(name) > 1 else (path.name,)
        stem = _stem("_".join((*parts[:-1], path.stem)), end)
        names.append(_distinct(stem, f"{end}{path.suffix.lower()}", names))
    return names


def _at_frame(file: str, time_code: float | None) -> str:
    name = frame_name(file)
    if time_code is None and name.has_holder:
        sentence = "The product's name has a placeholder for the frame's number: give the frames to render in settings.frames"
        raise SettingsError(sentence, where=file, code="frames")
    return name.of(time_code)


def _stem(text: str, end: str) -> str:
    """Return the text as letters, digits, _, - and single dots, beginning with a letter or digit and without the frame's
    number."""
    number = end.partition(".")[2]
    if number and re.search(rf"(^|[._-]){re.escape(number)}$", text):
        text = text[: -len(number)].rstrip("._-")
    text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    text = re.sub(r"\.{2,}", ".", re.sub(r"[^A-Za-z0-9_.-]+", "_", text))
    return text.lstrip("._-")[:LONGEST].rstrip("._-") or "picture"


def _distinct(stem: str, rest: str, taken: Sequence[str]) -> str:
    known, name, number = {each.casefold() for each in taken}, stem + rest, 2
    while name.casefold() in known:
        name, number = f"{stem}_{number}{rest}", number + 1
    return name
