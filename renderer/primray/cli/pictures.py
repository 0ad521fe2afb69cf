"""Output pictures of a command: checks before rendering, writing, and reporting after it.

This module does not import Typer (see quick.py).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..diagnostic_messages import SequenceNotices, print_diagnostics
from ..errors import SettingsError, UnsupportedError
from ..images.encoding import Encoding, check_bit_depth, check_half
from ..settings import StopAt
from ..time_spans import span
from .output_targets import TevOutputs, check_standard, is_standard, is_tev, suffix_of, write_standard

if TYPE_CHECKING:
    from ..color.color_space import ColorSpace
    from ..images.exposure import View
    from ..images.image import Image
    from ..settings import RenderSettings
    from .shots import Shot

UNFINISHED = "picture-unfinished"
Held = Callable[[str, "Image"], "Image"]


@dataclass(frozen=True)
class Looks:
    """How messages and pictures look, and whether output folders are created."""

    as_json: bool
    verbose: bool
    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float | Literal["auto"] | None = None  # None: that of the stage's product, else 0
    make_folders: bool = False
    chose_exposure: bool = False
    tev: TevOutputs = field(default_factory=TevOutputs)
    encoding: Encoding = field(default_factory=Encoding)
    notices: SequenceNotices = field(default_factory=SequenceNotices)
    names_space: bool = False  # --rendering-color-space was given, so views need not assume a space

    @property
    def is_chosen(self) -> bool:
        return not self.view == self.display == self.look is None

    def settled(self, image: Image) -> Looks:
        """Return these looks with "auto" replaced by the exposure for this picture, which later pictures share."""
        if self.exposure != "auto":
            return self
        from ..images.exposure import exposure_that_serves

        return replace(self, exposure=exposure_that_serves(image.seen, self.view_of(image)), chose_exposure=True)

    def settled_if_it_can_be(self, image: Image) -> Looks:
        """Return `settled`, or these looks if the view fails, which is reported when a file needs it."""
        try:
            return self.settled(image)
        except Exception:
            return self

    def view_of(self, image: Image) -> View:
        return image.view_of(self.view, self.display, self.look)

    def stops_of(self, image: Image) -> float:
        """Return the exposure of views of the image, in stops."""
        return image.file.view.exposure if self.exposure is None else 0.0 if self.exposure == "auto" else self.exposure

    def view_from(self, space: ColorSpace) -> View:
        from ..images.exposure import View

        return View(self.view, self.display, self.look, space)


def check_shots(shots: Sequence[Shot], looks: Looks) -> None:
    """Check the outputs of the first shot, and the paths of all others, whose folders may depend on the frame."""
    from ..images.image import check_output_path
    from ..images.output_path import make_folder

    first = shots[0]
    check_outputs(first.files, first.report, looks, first.settings)
    for shot in shots[1:]:
        files = [file for file in shot.files if not is_tev(file) and not is_standard(file)]
        if looks.make_folders:
            for name in files:
                make_folder(Path(name))
        for file in files:
            check_output_path(file)
        check_reports([] if shot.report is None else [shot.report], looks.make_folders)


def check_reports(files: Sequence[str], make_folders: bool) -> None:
    """Raise SettingsError if a report cannot be written."""
    from ..images.output_path import check_folder, make_folder

    for name in dict.fromkeys(files):
        if make_folders:
            make_folder(Path(name))
        check_folder(Path(name))


def check_outputs(files: list[str], report: str | None, looks: Looks, settings: RenderSettings | None = None) -> None:
    """Check before rendering that outputs can be written. `settings` are those of the render that follows, if any."""
    from ..images.image import check_output_path, shows_view
    from ..images.output_path import make_folder

    in_files = [file for file in files if not is_tev(file) and not is_standard(file)]
    check_standard(files, looks.as_json)
    suffixes = [suffix_of(file) for file in files if not is_tev(file)]
    check_bit_depth(looks.encoding, suffixes)
    check_half(looks.encoding, suffixes)
    if looks.make_folders:
        for name in in_files:
            make_folder(Path(name))
    for file in in_files:
        check_output_path(file)
    check_reports([] if report is None else [report], looks.make_folders)
    if looks.is_chosen or any(shows_view(Path(f"picture{suffix}"), looks.encoding) for suffix in suffixes):
        _check_view(looks, settings)
    for output in files:
        if is_tev(output):
            looks.tev.check(output)


def _check_view(looks: Looks, settings: RenderSettings | None) -> None:
    """Check the view from the requested colour space.

    A space authored in the stage is known only later; if the view fails then, the EXR is kept.
    """
    from ..color.color_space import REC709
    from ..color.ocio import rendering_space

    asked = None if settings is None else settings.rendering_color_space
    view = looks.view_from(REC709 if asked is None else rendering_space(asked))
    view.check()
    if settings is None or not settings.strict or settings.refusal.allows("view-space-assumed"):
        return
    if asked is None and (assumed := view.assumption()) is not None:
        raise SettingsError(f"--strict: {assumed.message}", where="rendering_color_space", code=assumed.code)


def save(image: Image, file: str, looks: Looks) -> None:
    from ..images.image import check_output_path

    if is_tev(file):
        return looks.tev.show(image, file)
    from ..images.image import shows_view

    if shows_view(Path(f"picture{suffix_of(file)}"), looks.encoding):
        looks = looks.settled(image)
    exposure = looks.stops_of(image)
    if is_standard(file):
        return write_standard(lambda path: image.write(path, looks.view_of(image), exposure, looks.encoding), file)
    image.write(check_output_path(file), looks.view_of(image), exposure, looks.encoding)


def _as_it_is(file: str, image: Image) -> Image:
    return image


def write(image: Image, shot: Shot, looks: Looks) -> bool:
    """Write a render's files and report its results; return False if any file could not be written.

    Such a file is reported, and the others are written.
    """
    files, held = shot.files, shot.image_in
    start = time.perf_counter()
    with span("write"):
        written, looks = save_all(files, lambda file, looks: save(held(file, image), file, looks), looks, image)
    kept = _keep_record(image, [file for file in files if file not in written], written, looks)
    report = finished_report(image, with_files_beside(image, written + kept, held), time.perf_counter() - start, looks, held)
    whole = shot.report is None or write_report(shot.report_file_of(report), shot.report, looks)
    tell(image, report, looks)
    return whole and written == files and is_finished(image)


def with_files_beside(image: Image, files: list[str], held: Held) -> list[str]:
    """Return the files that were written, with those beside them: deep pictures."""
    named = [file for file in files if is_record(file)]
    return [*files, *(str(other) for file in named for other in held(file, image).files_beside(file))]


def save_all(files: list[str], saving: Callable[[str, Looks], None], looks: Looks, image: Image) -> tuple[list[str], Looks]:
    """Write files; return those that were written, and the looks used.

    Records come first, so that a failing view or a closed standard output costs none of them.
    """
    records = [file for file in files if is_record(file)]
    written = {file for file in records if is_written(partial(saving, file, looks), looks)}
    looks = looks.settled_if_it_can_be(image)
    written |= {file for file in files if file not in records and is_written(partial(saving, file, looks), looks)}
    return [file for file in files if file in written], looks


def is_record(file: str) -> bool:
    """Return whether the file holds the whole picture, as an EXR on disk does."""
    return not is_tev(file) and not is_standard(file) and file.lower().endswith(".exr")


def is_finished(image: Image) -> bool:
    """Return whether all post-processing succeeded."""
    return all(row["code"] != UNFINISHED for row in image.report["diagnostics"])


def has_samples(image: Image) -> bool:
    most: int = image.report["samples_per_pixel"][1]
    return most > 0


def _keep_record(image: Image, lost: list[str], written: list[str], looks: Looks) -> list[str]:
    """Write an EXR instead of a picture that could not be written, so that its samples are not lost.

    This happens only if no other output is an EXR and no existing file would be overwritten.
    """
    places = [Path(file).with_suffix(".exr") for file in lost if not is_tev(file) and not is_standard(file)]
    free = [place for place in places if str(place) not in lost and not place.exists()]
    if any(map(is_record, written)) or not free:
        return []
    if not is_written(partial(save, image, str(free[0]), looks), looks):
        return []
    print(f"the picture was saved as {free[0]} instead, scene-linear", file=sys.stderr)
    return [str(free[0])]


def finished_report(image: Image, written: list[str], seconds: float, looks: Looks, held: Held = _as_it_is) -> dict[str, Any]:
    """Return the report with the files, the time to write them, and what views of them do not show."""
    stages_s = {**image.report["stages_s"], "write": seconds}
    report = {**image.report, "outputs": written, "stages_s": stages_s}
    rows = [row for file in written for row in held(file, image).report.get("diagnostics", ())]
    report["diagnostics"] = [*report["diagnostics"], *(row for row in rows if row not in report["diagnostics"])]
    with suppress(Exception):  # the same failure was already reported when the file was written
        report["diagnostics"] = [*report["diagnostics"], *_faults_of_view(image, written, looks, held)]
    if looks.chose_exposure:
        report["view_exposure"] = looks.exposure
    return report


def write_report(report: Mapping[str, Any], file: str, looks: Looks) -> bool:
    """Write the report; return False if that failed, which is reported."""
    from ..images.image import write_text
    from .console import dumps

    return is_written(partial(write_text, Path(file), dumps(report, indent=2) + "\n"), looks)


def tell(image: Image, report: dict[str, Any], looks: Looks) -> None:
    from .console import print_line

    settings = report["settings"]
    frame = settings["time_code"], settings.get("orbit_deg", 0.0)  # all frames of a turntable have one time code
    print_diagnostics(looks.notices.new(report["diagnostics"], frame), verbose=looks.verbose)
    if looks.as_json:
        print_line({"type": "report", **report})
    else:
        where = sys.stderr if any(map(is_standard, report["outputs"])) else sys.stdout
        print(_summary_line(image, report, report["outputs"]), file=where)


def tell_of_all(looks: Looks) -> None:
    """Print after the last frame how many frames each warning concerns."""
    for line in looks.notices.lines():
        print(line, file=sys.stderr)


def is_refused(image: Image, settings: RenderSettings, looks: Looks) -> bool:
    """Return whether the settings refuse diagnostics that arose during rendering, and print them; the picture is kept."""
    from ..diagnostics import Diagnostics
    from ..render.in_parts import diagnostics_of
    from .console import print_error

    found = Diagnostics()
    found.extend(diagnostics_of(image))
    try:
        found.raise_if_refused(settings.refusal)
    except UnsupportedError as error:
        print_error(error, looks.as_json)
        return True
    return False


def _faults_of_view(image: Image, files: list[str], looks: Looks, held: Held) -> list[dict[str, str]]:
    from ..images.image import faults_of_exr, shows_view

    names = [Path(f"picture{suffix_of(file)}") for file in files if not is_tev(file)]
    faults, view = [], looks.view_of(image)
    if looks.exposure != "auto" and any(shows_view(name, looks.encoding) for name in names):
        faults += [
            None if looks.names_space else view.assumption(),
            image.view_fault(view, looks.stops_of(image), is_auto=looks.chose_exposure),
        ]
    for held_image in _held_by_exrs(image, files, held):
        faults += [fault for fault in faults_of_exr(held_image, looks.encoding) if fault not in faults]
    return [fault.as_json() for fault in faults if fault is not None]


def _held_by_exrs(image: Image, files: list[str], held: Held) -> list[Image]:
    """Return the images that the EXRs hold, without duplicates."""
    found = [held(file, image) for file in files if not is_tev(file) and suffix_of(file).lower() == ".exr"]
    return list({id(held_image): held_image for held_image in found}.values())


def is_written(writing: Callable[[], None], looks: Looks) -> bool:
    from .console import print_error

    try:
        writing()
    except Exception as error:  # continue with the other files after any error
        print_error(error, looks.as_json)
        return False
    return True


def _summary_line(image: Image, report: dict[str, Any], files: list[str]) -> str:
    width, height = image.resolution
    low, high = report["samples_per_pixel"]
    samples = f"{low}" if low == high else f"{low} to {high}"
    names = ", ".join(files) or "not written"
    lines = [_error_line(report)]
    if "left_out" in report:
        from ..report.picture_checks import left_out_lines

        lines += left_out_lines(report)
    if "view_exposure" in report:
        names += f" (exposure {report['view_exposure']:+.2f})"
    return (
        f"{names}: {width} x {height}, {samples} samples a pixel in {report['stages_s']['render']:.2f} s "
        f"({report['rays_per_s'] / 1e6:.1f} Mrays/s, {sum(report['stages_s'].values()):.2f} s in all)\n" + "\n".join(lines)
    )


def _error_line(report: dict[str, Any]) -> str:
    """Return the picture's error, and why the render stopped."""
    if any(diagnostic["code"] == "empty-picture" for diagnostic in report["diagnostics"]):
        return f"nothing is visible, so the error is unknown; stopped by {report['stop']['reason']}"
    metric = report["settings"]["error_metric"]
    found, target, stops_at = report["error"][metric], report["settings"]["target_error"], report["settings"]["stop_at"]
    if found is None:
        return f"no error estimate: {_too_few(report['samples_per_pixel'][0])}; stopped by {report['stop']['reason']}"
    low, high = found["ci95"]
    line = f"{metric} {found['estimate']:.3g} (95 %: {low:.3g} to {high:.3g})"
    if target is not None:
        what = "target of the denoised picture" if stops_at == StopAt.DENOISED.value else "target"
        met = "reached" if report["stop"]["target_met"] else "NOT reached"
        if stops_at == StopAt.MIX.value:
            line += f"; {_mix_text(report, metric)}"
        line += f", {what} {target:g} {met}"
    from ..report.vague_error import why_it_continued

    explained = [report["error_ruled_by"]["message"]] if "error_ruled_by" in report else []
    explained += [why] if (why := why_it_continued(report)) else []
    ruled = "".join(f"\n{sentence}" for sentence in explained)
    return f"{line}; stopped by {report['stop']['reason']}{ruled}{_denoised_text(report.get('denoised'), metric)}"


def _mix_text(report: dict[str, Any], metric: str) -> str:
    """Return the error of the mix of lights that has the largest."""
    found, mixes = report["error"]["mix"], report["settings"]["mixes"]
    low, high = found[metric]["ci95"]
    of = "the mix" if len(mixes) == 1 else f"the worst of {len(mixes)} mixes ({mixes[found['worst']]})"
    return f"{of}: {found[metric]['estimate']:.3g} (95 %: {low:.3g} to {high:.3g})"


def _too_few(samples: int) -> str:
    """Return why there is no error estimate, from the smallest number of samples of a pixel."""
    return {0: "some pixels have no samples", 1: "only one sample a pixel"}.get(samples, "the display view cannot be made")


def _denoised_text(denoised: dict[str, Any] | None, metric: str) -> str:
    if denoised is None:
        return ""
    found = (denoised["error"] or {}).get(metric)
    if found is None:
        return "\ndenoised: biased, error unknown"
    low, high = found["ci95"]
    return f"\ndenoised: {metric} {found['estimate']:.3g} (95 %: {low:.3g} to {high:.3g}), biased"
