"""The fixture `primray_image`: renders a stage, compares it with its reference, and keeps evidence of a failure.

A reference may be a view (PNG, JPEG, TIFF), which has no error channels. Its noise is that of the picture, propagated through
the view, plus quantization; the reference is assumed to have the same, scaled by its number of samples.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ..arrays import Floats
from ..errors import PrimrayError, SettingsError
from ..images.exposure import View
from ..images.reading import MeasuredImage, read_measured, space_of
from ..settings import RenderSettings
from .aov_tests import aovs_in, compare_with_aovs
from .comparison import DEFAULT_ALPHA, DEFAULT_TILE, DEFAULT_TOLERANCE, Comparison, Verdict, compare
from .comparison_report import as_json, lines, save_difference


def render_file(stage: Any, settings: RenderSettings, *paths: Path) -> int:
    """Render a stage to files, EXRs with error channels; return its samples per pixel, rounded up."""
    from ..render import render

    image = render(stage, settings)
    for path in paths:
        image.save(path)
    width, height = image.resolution
    return -(-int(image.report["samples"]) // (width * height))


class ImageCheck:
    """Picture check of one test.

    `folder`: base of relative paths. `written`: collects references that are updated (--primray-update), else None. `failed` is
    called with folders of evidence.
    """

    def __init__(
        self, folder: Path, evidence: Path, written: list[str] | None, failed: Callable[[Path], None] = lambda kept: None
    ) -> None:
        self.folder = folder
        self.evidence = evidence
        self.written = written
        self.failed = failed
        self._folders: dict[str, Path] = {}  # by reference

    def __call__(
        self,
        stage: str | os.PathLike[str] | Any,
        reference: str | os.PathLike[str],
        *,
        spp: int | None = None,
        resolution: tuple[int, int] | None = None,
        camera: str | None = None,
        settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
        alpha: float = DEFAULT_ALPHA,
        tolerance: float = DEFAULT_TOLERANCE,
        tile: int = DEFAULT_TILE,
        max_spp: int | None = None,
        reference_spp: int | None = None,
        allow_undecided: bool = False,
        aovs: Sequence[str] = (),
    ) -> Comparison:
        """Fail the test if the picture has changed, or if noise could hide a change of `tolerance` (relative).

        `spp`, `resolution` and `camera` replace those of `settings`. A picture that is undecided with `spp` samples is
        rendered again with as many as it needs, up to `max_spp` (None: 4 times `spp`). References are rendered with
        `reference_spp` (None: like the picture; an unchanged scene then gives identical pixels). `aovs` named here are
        rendered with their errors, and compared as well.
        """
        __tracebackhide__ = True
        asked: dict[str, Any] = {"spp": spp, "resolution": resolution, "camera": camera}
        try:
            settings = replace(settings, **{name: value for name, value in asked.items() if value is not None})
            if aovs:
                settings = replace(settings, aovs=settings.aovs or tuple(aovs), aov_errors=True)
            stage = str(self.folder / stage) if isinstance(stage, str | os.PathLike) else stage
            path = self.folder / reference
            if self.written is not None:
                return self._update(stage, path, replace(settings, spp=reference_spp or settings.spp))
            if not path.is_file():
                pytest.fail(f"the reference {path} does not exist; `pytest --primray-update` renders it", pytrace=False)
            # Two comparisons share the false-alarm rate.
            criteria: dict[str, Any] = {"alpha": alpha / 2, "tolerance": tolerance, "tile": tile, "aovs": list(aovs)}
            return self._check(stage, path, settings, max_spp, criteria, allow_undecided, reference_spp)
        except PrimrayError as error:
            pytest.fail(f"{reference}: {error}", pytrace=False)

    def _update(self, stage: Any, path: Path, settings: RenderSettings) -> Comparison:
        path.parent.mkdir(parents=True, exist_ok=True)
        render_file(stage, settings, path)
        assert self.written is not None
        self.written.append(str(path))
        return _compared(path, path)

    def _check(
        self,
        stage: Any,
        path: Path,
        settings: RenderSettings,
        max_spp: int | None,
        criteria: dict[str, Any],
        allow_undecided: bool,
        reference_spp: int | None,
    ) -> Comparison:
        __tracebackhide__ = True
        kept = self._folder_of(path)
        kept.mkdir(parents=True, exist_ok=True)
        rendered = kept / "render.exr"
        if path.suffix.lower() != ".exr" and read_measured(path).is_display:
            shown = kept / f"render{path.suffix}"
            first = cap = render_file(stage, settings, rendered, shown)
            share = first / reference_spp if reference_spp else 1.0
            result = _compared_as_shown(path, shown, rendered, share**0.5, **criteria)
            return self._judged(result, path, kept, cap, allow_undecided)
        first = render_file(stage, settings, rendered)
        cap = 4 * first if max_spp is None else max_spp
        result = _compared(path, rendered, **criteria)
        spp = _spp_that_decides(result, first, cap)
        if spp > first:
            render_file(stage, replace(settings, spp=spp, target_error=None, time_limit_s=None), rendered)
            result = _compared(path, rendered, **criteria)
        return self._judged(result, path, kept, cap, allow_undecided)

    def _folder_of(self, path: Path) -> Path:
        """Return the evidence folder of a reference.

        Two references of a test may have the same name in different folders or formats.
        """
        taken = set(self._folders.values())
        named = [self.evidence / path.stem, *(self.evidence / f"{path.stem}-{n}" for n in range(2, len(taken) + 3))]
        return self._folders.setdefault(str(path), next(folder for folder in named if folder not in taken))

    def _judged(self, result: Comparison, path: Path, kept: Path, cap: int, allow_undecided: bool) -> Comparison:
        __tracebackhide__ = True
        if result.verdict is Verdict.UNCHANGED or (result.verdict is Verdict.UNDECIDED and allow_undecided):
            shutil.rmtree(kept)
            return result
        self._keep(result, path, kept)
        self.failed(kept)
        pytest.fail(_message(result, path, kept, cap), pytrace=False)

    def _keep(self, result: Comparison, path: Path, kept: Path) -> None:
        from ..images.image import write_text

        shutil.copyfile(path, kept / f"reference{path.suffix.lower()}")
        save_difference(result, kept / "difference.png")
        facts = {"a": str(path), "b": str(kept / "render.exr"), **as_json(result)}
        facts["words"] = list(lines(result, path.name, "the picture rendered now"))
        write_text(kept / "report.json", json.dumps(facts, indent=2, allow_nan=False) + "\n")


def _compared(a: Path, b: Path, *, aovs: Sequence[str] = (), **criteria: Any) -> Comparison:
    if not aovs:
        return compare(read_measured(a), read_measured(b), **criteria)
    return compare_with_aovs((read_measured(a), read_measured(b)), (aovs_in(a), aovs_in(b)), aovs, **criteria)


def _compared_as_shown(
    path: Path, shown: Path, record: Path, of_reference: float, *, aovs: Sequence[str] = (), **criteria: Any
) -> Comparison:
    if aovs:
        raise SettingsError("a display picture has no AOVs; use an EXR as reference", where=str(path), code="image-display")
    reference, now = with_noise(read_measured(path), read_measured(shown), read_measured(record), of_reference)
    result = compare(reference, now, **criteria)
    return result if result.identical else replace(result, notes=(*result.notes, NOTE))


def _spp_that_decides(result: Comparison, spp: int, cap: int) -> int:
    """Return the samples for a second render, with the reference unchanged; `spp` if more would not help."""
    if result.verdict is not Verdict.UNDECIDED or result.needs is None or result.needs.b_alone is None:
        return spp
    return min(cap, 2 * ((spp + result.needs.b_alone * 5 // 4 + 1) // 2))


def _message(result: Comparison, path: Path, kept: Path, cap: int) -> str:
    """Return what happened, where, and what to do."""
    said = "\n".join(lines(result, path.name, "the picture rendered now"))
    if result.verdict is Verdict.CHANGED:
        advice = "if the change is intended: pytest --primray-update"
    elif result.needs is not None and result.needs.b_alone is None:
        advice = "the reference is too noisy: render it with a larger reference_spp, or increase the tolerance"
    else:
        advice = f"more than max_spp={cap} would be needed: raise it, increase the tolerance, or set allow_undecided=True"
    files = ", ".join(sorted(file.name for file in kept.iterdir()))
    return f"{said}\n  evidence: {kept} ({files})\n  {advice}"


NOTE = "the reference is a display picture without errors: it is assumed to be as noisy as the picture rendered now"
STEPS = {"uint8": 255, "uint16": 65535}


def with_noise(
    reference: MeasuredImage, shown: MeasuredImage, record: MeasuredImage, of_reference: float
) -> tuple[MeasuredImage, MeasuredImage]:
    """Return the reference and the view `shown` of `record`, with standard errors.

    `of_reference` scales the errors of the reference. Identical pictures need none.
    """
    if record.stderr is None or (reference.pixels.shape == shown.pixels.shape and (reference.pixels == shown.pixels).all()):
        return reference, shown
    noise = _through_view(record, shown)
    made = []
    for picture, scale in ((reference, of_reference), (shown, 1.0)):
        step = 1.0 / STEPS.get(picture.stored, 255) / 12**0.5  # standard deviation of uniform quantization
        made.append(replace(picture, stderr=np.sqrt((scale * noise) ** 2 + step**2).astype(np.float32)))
    return made[0], made[1]


def _through_view(record: MeasuredImage, shown: MeasuredImage) -> Floats:
    """Return standard errors (H, W, 3) of display values, infinite where unknown.

    Each is half the difference of the view at plus and minus one error.
    """
    assert record.stderr is not None
    view = View(space=space_of(record.chromaticities))
    alpha = np.ones_like(record.pixels[..., :1])
    if shown.alpha is not None and record.alpha is not None:
        alpha = np.clip(record.alpha[..., None], 0, 1)
    inverse = np.divide(1, alpha, out=np.zeros_like(alpha), where=alpha > 0)
    known = np.isfinite(record.stderr)
    rgb = np.nan_to_num(record.pixels * inverse)
    error = np.where(known, record.stderr, 0) * inverse
    low, high = (np.clip(np.nan_to_num(view.shown((rgb + sign * error).astype(np.float32))), 0, 1) for sign in (-1, 1))
    found: Floats = np.where(known, np.abs(high - low) / 2 * alpha, np.inf).astype(np.float32)
    return found
