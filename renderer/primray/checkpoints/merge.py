"""Merging of checkpoints with disjoint samples to the picture and checkpoint of one render that took all samples.

No stage is needed: everything that an image and its report say about the scene is in the checkpoints.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from .. import core
from ..denoising.denoiser import Guides, has_denoiser
from ..diagnostics import UNFINISHED as PICTURE_UNFINISHED
from ..diagnostics import Diagnostics, kept_without
from ..images.aov import Aov
from ..images.image import Image, pixels_sha256
from ..images.light_path_aovs import light_paths_of
from ..report.report import Costs, header_of, make_report, settings_as_json, subject_of
from ..sampling.sampling import Sampling
from .checkpoint import Range, check, contents, gaps
from .checkpoint_file import write_checkpoint
from .gathering import Gathering
from .kept_beside import aovs_of_parts

# Diagnostics about the merged samples, which each merge reports again.
OF_SAMPLES = ("samples-missing", "invalid-samples", "aovs-not-merged", "display-error-unknown", PICTURE_UNFINISHED)


@dataclass(frozen=True)
class Merged:
    image: Image
    header: dict[str, Any]
    arrays: dict[str, Any]

    @property
    def time_code(self) -> float | None:
        """Time code of the frame that the parts belong to; None: the stage's default time."""
        found = self.header["settings"]["time_code"]
        return None if found is None else float(found)

    def save_checkpoint(self, path: Path) -> None:
        write_checkpoint(path, self.header, self.arrays)


def merge(paths: Sequence[Path]) -> Merged:
    """Merge checkpoints; CheckpointError, naming the file, unless all are complete parts of one picture without overlap."""
    costs = Costs()
    with costs.stage("render"):
        gathering = gathered(paths)
        sampling = gathering.sampling(gathering.settings(all_of(gathering.ranges)))
        sampling.run()  # takes no sample: they are all there; measures
    return picture_of_parts(gathering, sampling, costs, {"parts": [str(path) for path in paths]})


def gathered(paths: Sequence[Path]) -> Gathering:
    """Return the sum of checkpoints; raise CheckpointError as `merge` does."""
    for path in paths:
        check(path)
    gathering = Gathering()
    for path in paths:
        gathering.add(path)
    return gathering


def all_of(ranges: tuple[Range, ...]) -> dict[str, Any]:
    """Return the stopping rules of one render of all these samples; with gaps, of the range that they span."""
    first, end = ranges[0][0], ranges[-1][1]
    whole = len(ranges) == 1 and first == 0
    spans = {"spp": end if whole else None, "sample_range": None if whole else [first, end]}
    return spans | {"target_error": None, "time_limit_s": None, "adaptive": None}


def picture_of_parts(gathering: Gathering, sampling: Sampling, costs: Costs, says: Mapping[str, Any]) -> Merged:
    """Return the picture and checkpoint of a sampling of parts that has ended; `says` is added to the report."""
    pixels, errors = sampling.film.image()
    kept, own, found = gathering.beside, Diagnostics(), dict[str, Aov]()
    if sampling.view_fault:
        own.add("display-error-unknown", "", sampling.view_fault)
    with costs.stage("aovs"):
        with kept_without("the AOV data of the parts", own):
            found |= {} if kept is None else aovs_of_parts(kept, sampling.film)
        with kept_without("the light path output", own):
            found |= light_paths(gathering, sampling)
        aovs = {name: found[name] for name in gathering.held[0].about.aovs if name in found}
    denoises = sampling.settings.denoises and kept is not None and kept.guides is not None and has_denoiser()
    diagnostics = _diagnostics(sampling, gathering, {*aovs, *(["denoised"] if denoises else [])}, own)
    about = replace(gathering.held[0].about, diagnostics=diagnostics, settings=settings_as_json(sampling.settings), beside=kept)
    ranges = [list(r) for r in gathering.ranges]
    core_says = {"isa": core.isa(), "lanes": core.lanes(), "versions": core.versions(), "features": about.features}
    report = make_report(sampling, costs, about.counts, diagnostics, core_says, pixels_sha256(pixels), about.rendering_space)
    metadata = header_of(report) | subject_of(about.stage, about.camera)
    report["aovs"] = {name: aov.as_json() for name, aov in aovs.items()}
    report |= {"labels": dict(kept.labels)} if kept is not None and kept.labels else {}
    report |= {"frame": asdict(about.frame), "motion": about.motion} | dict(says) | {"sample_ranges": ranges}
    camera, frame, space = about.camera, about.frame, about.rendering_space
    image = Image(pixels, report, metadata, camera, errors=errors, frame=frame, aovs=aovs, color_space=space, file=about.file)
    after = Diagnostics()
    if denoises and kept is not None and kept.guides is not None:
        with kept_without("the denoised picture", after):
            image = _denoised(image, kept.guides, sampling, costs)
    header, arrays = contents(sampling, about)
    if about.camera.diffusion.strength > 0:
        from ..diffusing.diffuse import with_diffusion

        with kept_without("the diffused picture", after):
            image = with_diffusion(image)
    diagnostics += [diagnostic.as_json() for diagnostic in after]
    return Merged(image, header | {"ranges": ranges}, arrays)


def light_paths(gathering: Gathering, sampling: Sampling) -> dict[str, Aov]:
    """Return the light path outputs that films hold, by name."""
    held = gathering.held[0].about.light_paths
    if held is None:
        return {}
    return light_paths_of(held.requests, held.expressions, held.members, sampling.film)


def _denoised(image: Image, guides: Guides, sampling: Sampling, costs: Costs) -> Image:
    from ..denoising.denoised import Denoising, with_denoised

    assert image.camera is not None
    with costs.stage("denoise"):
        return with_denoised(image, Denoising(guides, image.camera.exposure_scale, sampling.settings).of(sampling.film))


def _diagnostics(sampling: Sampling, gathering: Gathering, made: Container[str], own: Diagnostics) -> list[dict[str, str]]:
    """Return the parts' diagnostics, and `own`, with those found here added to it."""
    held, ranges = gathering.held, gathering.ranges
    missing = ([(0, ranges[0][0])] if ranges[0][0] > 0 else []) + gaps(ranges)
    if missing:
        spans = ", ".join(f"{a}:{b}" for a, b in missing)
        own.add("samples-missing", "", f"samples {spans} are in none of the parts")
    asked = sorted({name for part in held for name in part.about.aovs})
    asked += ["denoised"] if any(part.about.settings.get("denoise") for part in held) else []
    missing_names = [name for name in asked if name not in made]
    if missing_names:
        own.add("aovs-not-merged", "", f"{', '.join(missing_names)} are not in the checkpoints that were merged")
    film = sampling.film
    if film.invalid_samples:
        own.add("invalid-samples", "", f"{film.invalid_samples} of {film.samples} samples are left out")
    rows = [row for part in held for row in part.about.diagnostics if row.get("code") not in OF_SAMPLES]
    rows += [diagnostic.as_json() for diagnostic in own]
    return list({tuple(row.items()): row for row in rows}.values())
