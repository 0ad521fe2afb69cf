"""The pipeline from a stage to an image: open, translate, load textures, build the scene, sample, report.

Expensive modules are imported when a render starts; importing this module is cheap.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, replace
from inspect import Parameter, signature
from itertools import chain, repeat
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Unpack

from ..errors import RenderCancelled, SettingsError
from ..report.prepared import Prepared
from ..settings import RenderSettings, with_values
from .interruption import Interruption, interruption
from .prepare import OpenedStage, composing_settings, open_once, prepare

if TYPE_CHECKING:
    from ..aovs import AovRequest
    from ..checkpoints.checkpointing import Checkpointing
    from ..core import CoreScene
    from ..diagnostics import Diagnostics
    from ..distributed.executor import PartsExecutor
    from ..images.aov import Aov
    from ..images.background import Backdrop
    from ..images.deep import DeepPicture
    from ..images.image import Image
    from ..report.report import Costs
    from ..sampling.sampling import Progress, Sampling
    from ..settings.written import SettingsValues
    from .prepare import Steps
    from .progress import Snapshots

    Tell = Callable[[Diagnostics], None]


Function = TypeVar("Function", bound=Callable[..., object])


def with_setting_names(function: Function) -> Function:
    """Return the function with its `**values` spelled out in its signature."""
    own = signature(function)
    kept = [p for p in own.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    fields = [p.replace(kind=Parameter.KEYWORD_ONLY) for p in signature(RenderSettings).parameters.values()]
    function.__signature__ = own.replace(parameters=[*kept, *fields])  # type: ignore[attr-defined]
    return function


OnInterrupt = Literal["raise", "partial"]


@with_setting_names
def render(
    stage: str | os.PathLike[str] | Any,
    settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
    *,
    progress: Progress | Literal[False] | None = None,
    on_interrupt: OnInterrupt = "raise",
    checkpointing: Checkpointing | None = None,
    executor: PartsExecutor | None = None,
    **values: Unpack[SettingsValues],
) -> Image:
    """Render a stage, given as a Usd.Stage or a path. Fields of RenderSettings may be passed by name.

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=2, seed=1)
    >>> image.pixels.shape
    (18, 32, 4)

    `progress(fraction, samples, rays)` is called about ten times a second. None: a bar in notebooks; False: nothing.
    Ctrl-C raises KeyboardInterrupt and `progress` returning False raises RenderCancelled, unless `on_interrupt` is
    "partial": then the picture so far is returned, and its report says "interrupted". A checkpoint is written before either.
    `executor` renders the frame's samples in parts, in several processes or on several machines, to the bits of one render
    without adaptive sampling; it opens the stage by its path.

    Raises SceneError, SettingsError or LimitError, all PrimrayErrors, if no picture can be made. Differences from what the
    stage says are diagnostics: a RenderWarning, log records of "primray", and entries in `Image.report`.
    """
    settings = with_values(settings, values)
    if executor is not None:
        return _in_parts(stage, settings, executor, progress, on_interrupt, checkpointing)
    return next(rendered_frames(stage, [settings], progress=progress, on_interrupt=on_interrupt, checkpointing=[checkpointing]))


def _in_parts(
    stage: str | os.PathLike[str] | Any,
    settings: RenderSettings,
    executor: PartsExecutor,
    progress: Progress | Literal[False] | None,
    on_interrupt: OnInterrupt,
    checkpointing: Checkpointing | None,
) -> Image:
    from ..diagnostic_messages import Announcer
    from .in_parts import diagnostics_of, render_in_parts
    from .progress import shown_progress

    if checkpointing is not None:
        raise SettingsError("a frame that is rendered in parts has no checkpoints", where="checkpointing", code="parts-setting")
    with shown_progress(progress) as shown:
        image = render_in_parts(stage, settings, executor, shown, on_interrupt)
    Announcer(stage).tell(diagnostics_of(image))
    return image


class OpenedFrames:
    """An open stage that renders pictures. Nothing but the stage is kept between them."""

    def __init__(self, stage: str | os.PathLike[str] | OpenedStage | Any, settings: RenderSettings) -> None:
        self.opened = stage if isinstance(stage, OpenedStage) else open_once(stage, settings)
        self._is_told = False  # whether a report includes the time of opening

    @contextmanager
    def steps(self, costs: Costs) -> Iterator[Steps | None]:
        """Yield the pipeline that a picture is prepared with, as for `prepare`."""
        if not self._is_told:
            costs.stages_s["open"], self._is_told = self.opened.seconds, True
        yield None

    def render(
        self,
        settings: RenderSettings,
        progress: Progress | None,
        on_interrupt: OnInterrupt,
        checkpointing: Checkpointing | None,
        snapshots: Sequence[Snapshots],
        tell: Tell,
        measures_error: bool = True,
    ) -> Image:
        """Render one picture, as `render_opened` does."""
        from ..report.report import Costs

        costs = Costs()
        with self.steps(costs) as steps:
            return render_opened(
                self.opened,
                settings,
                costs,
                progress,
                on_interrupt,
                checkpointing,
                snapshots,
                tell,
                steps,
                measures_error=measures_error,
            )


Open = Callable[[Any, RenderSettings], OpenedFrames]


def rendered_frames(
    stage: str | os.PathLike[str] | OpenedStage | Any,
    frames: Iterable[RenderSettings],
    *,
    progress: Progress | Literal[False] | None = None,
    on_interrupt: OnInterrupt = "raise",
    checkpointing: Iterable[Checkpointing | None] = (),
    snapshots: Sequence[Snapshots] = (),
    is_quiet: bool = False,
    opening: Open = OpenedFrames,
) -> Iterator[Image]:
    """Yield pictures of one stage, opened once.

    `is_quiet`: no warnings, log or progress bar, for callers that show these themselves.
    """
    from ..diagnostic_messages import Announcer
    from .progress import shown_progress

    own = None if progress is False else progress
    opened: OpenedFrames | None = None
    for settings, saved in zip(frames, chain(checkpointing, repeat(None)), strict=False):
        if opened is None:
            opened = opening(stage, settings)
        if composing_settings(settings) != opened.opened.composed_by:
            raise SettingsError("all frames must have the same composition settings: variants, load, mask, session_layer")
        showing: AbstractContextManager[Progress | None] = nullcontext(own) if is_quiet else shown_progress(progress)
        with showing as shown:
            tell: Tell = (lambda diagnostics: None) if is_quiet else Announcer(opened.opened.name).tell
            image = opened.render(settings, shown, on_interrupt, saved, snapshots, tell)
        yield image


def render_opened(
    opened: OpenedStage,
    settings: RenderSettings,
    costs: Costs,
    progress: Progress | None,
    on_interrupt: OnInterrupt,
    checkpointing: Checkpointing | None,
    snapshots: Sequence[Snapshots],
    tell: Tell,
    steps: Steps | None = None,
    measures_error: bool = True,
) -> Image:
    """Render one picture of a stage; `steps` as for `prepare`. `measures_error`: at its end, for the report alone."""
    from ..denoising.denoised import check_denoising, denoised_target
    from ..diagnostics import Diagnostics
    from ..sampling.sampling import Sampling, run_with_saving

    diagnostics = Diagnostics()
    if checkpointing is not None:
        checkpointing.check()
    check_denoising(settings)
    fingerprinted = checkpointing is not None
    prepared = prepare(opened.stage, opened.diagnostics, settings, costs, diagnostics, fingerprinted=fingerprinted, steps=steps)
    tell(diagnostics)  # before hours of sampling
    saved: dict[str, Any] = {}
    with costs.stage("render"), interruption() as asked:
        watched = _Watched(progress, asked)
        savings = [taken.of(prepared) for taken in snapshots]
        if checkpointing is None:
            sampling = Sampling.begin(prepared.scene, prepared.settings)
            sampling.measures_at_end = measures_error
            sampling.judge_by = denoised_target(prepared.scene, prepared.settings)
            sampling.mixes = prepared.mixes
            run_with_saving(sampling, watched, savings)
        else:
            sampling, saved = checkpointing.run(prepared, list(diagnostics), watched, savings)
        sampling.film.image()
    assert sampling.stop is not None
    if asked.asked:  # even if this frame was complete by then, others may follow
        sampling.stop = replace(sampling.stop, reason="interrupted")
    if sampling.stop.reason == "interrupted" and on_interrupt == "raise":
        if watched.stopped:
            raise RenderCancelled("the render was stopped by its progress callback")
        raise KeyboardInterrupt

    if saved:
        costs.checkpoint = saved
    image = picture_of(prepared, sampling, costs, diagnostics)
    tell(diagnostics)
    return image


def picture_of(prepared: Prepared, sampling: Sampling, costs: Costs, diagnostics: Diagnostics) -> Image:
    """Return the image of a render that has ended, with its report; diagnostics of sampling are added to `diagnostics`."""
    from ..diagnostics import kept_without
    from ..images.image import Foreground, Image, pixels_sha256
    from ..report.picture_checks import is_bare, is_empty, note_unseen_walks, why_empty
    from ..report.report import header_of, make_report, subject_of
    from ..report.vague_error import what_rules

    film, failed = sampling.film, (costs.checkpoint or {}).get("failed")
    if failed:
        diagnostics.add("checkpoint-unwritten", "", failed)
    if film.invalid_samples:
        diagnostics.add("invalid-samples", "", f"{film.invalid_samples} of {film.samples} samples are left out")
    pixels, errors = film.image()
    if _are_all_sampled(sampling, diagnostics) and (is_empty(pixels, diagnostics) or is_bare(prepared, diagnostics)):
        diagnostics.add("empty-picture", prepared.camera.path, why_empty(prepared, pixels, diagnostics))
        diagnostics.raise_if_refused(prepared.settings.refusal)
    if sampling.view_fault:
        diagnostics.add("display-error-unknown", "", sampling.view_fault)
    space = prepared.scene.rendering_space
    backdrop, rendered, foreground = _backdrop(prepared, sampling, costs), pixels, None
    if backdrop is not None:
        pixels, foreground = backdrop.behind(rendered), Foreground(rendered, backdrop.exposed)
    note_unseen_walks(prepared, film, diagnostics)
    aovs, of_labels = find_aovs(prepared, sampling, costs, diagnostics)
    as_json = [diagnostic.as_json() for diagnostic in diagnostics]
    report = make_report(sampling, costs, prepared.counts, as_json, core_facts(prepared.scene), pixels_sha256(pixels), space)
    metadata = header_of(report) | subject_of(prepared.stage, prepared.camera)
    with kept_without("the main cause of the error", diagnostics):
        rules = what_rules(prepared, sampling, report, rendered, errors)
        report |= {"error_ruled_by": rules} if rules is not None else {}
    report["stage_settings"] = prepared.asked.as_json()
    report["aovs"] = {name: aov.as_json() for name, aov in aovs.items()}
    deep = _deep_picture(prepared, sampling, costs)
    report |= {"deep": deep.as_json()} if deep is not None else {}
    report |= {"labels": of_labels} if of_labels else {}
    report["frame"] = asdict(prepared.frame)
    report["motion"] = prepared.motion
    camera, frame = prepared.camera, prepared.frame
    image = Image(pixels, report, metadata, camera, errors=errors, frame=frame, aovs=aovs, color_space=space, deep=deep)
    image = replace(image, file=prepared.file or image.file, foreground=foreground)
    if prepared.settings.denoises:
        with kept_without("the denoised picture", diagnostics):
            image = _denoised(image, prepared, sampling, costs)
            _note_if_worse(image, diagnostics)
            image = image if backdrop is None else backdrop.behind_denoised(image, rendered[..., 3:])
    if camera.diffusion.strength != 0:
        from ..images.glare import with_diffusion

        with kept_without("the diffused picture", diagnostics), costs.stage("diffusion"):
            image = with_diffusion(image)
    as_json += [diagnostic.as_json() for diagnostic in list(diagnostics)[len(as_json) :]]
    return image


def _deep_picture(prepared: Prepared, sampling: Sampling, costs: Costs) -> DeepPicture | None:
    """Return the deep picture, if one is requested."""
    from ..aovs import has_deep

    if not has_deep(prepared.aovs):
        return None
    from ..images.deep import deep_of_film

    with costs.stage("deep"):
        return deep_of_film(sampling.film)


def _are_all_sampled(sampling: Sampling, diagnostics: Diagnostics) -> bool:
    """Return whether every pixel has a sample, and report pixels that a render which was stopped early never reached."""
    if sampling.film.samples_per_pixel[0] > 0:
        return True
    missing = float((sampling.film.counts.sum(axis=0) == 0).mean())
    reason = sampling.stop.reason if sampling.stop is not None else "interrupted"
    message = f"{100 * missing:.3g} % of the pixels have no sample and are black and transparent: {reason} came first"
    diagnostics.add("unsampled-pixels", "", message)
    return False


def _backdrop(prepared: Prepared, sampling: Sampling, costs: Costs) -> Backdrop | None:
    """Return what is composited under the picture, or None."""
    shadow, asked = prepared.ground_shadow, prepared.settings.background
    if shadow is None and asked is None:
        return None
    from ..images.background import Backdrop, background_of

    opacity = denoised = None
    if shadow is not None:
        from ..staging import Spent

        film = sampling.film
        with costs.stage("ground_shadow"):
            opacity = shadow.opacity(film.image()[0][..., 3], Spent(sampling.mean_samples(), film.rays))
        if prepared.settings.denoises:
            from ..denoising.denoised import denoised_shadow

            with costs.stage("denoise"):
                denoised = denoised_shadow(opacity, prepared.settings)
    lit_behind = prepared.file is not None and prepared.file.lit_behind
    return Backdrop(
        shadow=opacity,
        background=background_of(asked),
        frame=prepared.frame,
        space=prepared.scene.rendering_space,
        denoised_shadow=denoised,
        lit_behind=lit_behind,
    )


def _note_if_worse(image: Image, diagnostics: Diagnostics) -> None:
    """Report a denoised picture whose error is above that of the picture it was made of."""
    from ..denoising.denoised import worse_than_record

    if said := worse_than_record(image.report):
        diagnostics.add("denoised-worse", "", said)


def _denoised(image: Image, prepared: Prepared, sampling: Sampling, costs: Costs) -> Image:
    """Return the image with its denoised picture.

    A picture that a denoised target made last is of all samples, and is not made again.
    """
    from ..denoising.denoised import DenoisedTarget, Denoising, guides_of, with_denoised

    with costs.stage("denoise"):
        judge = sampling.judge_by
        if isinstance(judge, DenoisedTarget):
            return with_denoised(image, judge.denoised(sampling))
        scene, settings = prepared.scene, prepared.settings
        return with_denoised(image, Denoising(guides_of(scene, settings), scene.exposure_scale, settings).of(sampling.film))


def find_aovs(
    prepared: Prepared, sampling: Sampling | None, costs: Costs, diagnostics: Diagnostics
) -> tuple[dict[str, Aov], dict[str, Any]]:
    """Return the AOVs by name, and the report's facts about labels; failures are added to `diagnostics`.

    Without `sampling`, AOVs that are made of samples must not be requested.
    """
    if not prepared.aovs:
        return {}, {}
    from ..aovs import CRYPTOMATTES, DEEP, light_path_of, taxonomy_of
    from ..diagnostics import kept_without
    from ..images.cryptomatte import mattes_of
    from ..images.first_hit import aovs_and_planes_of
    from ..images.light_path_aovs import light_paths_of_film
    from ..labels.view import labels_of_view, planes_of_labels

    mattes = [request for request in prepared.aovs if request.source in CRYPTOMATTES]
    labels = [request for request in prepared.aovs if taxonomy_of(request.source)]
    routed = [request for request in prepared.aovs if light_path_of(request.source) is not None]
    others = (*mattes, *labels, *routed)
    plain = [request for request in prepared.aovs if request not in others and request.source != DEEP]
    says: dict[str, Any] = {}
    found: dict[str, Aov] = {}
    planes: Mapping[str, Any] | None = None
    counts = None if sampling is None else sampling.film.counts

    def kept(requests: Sequence[AovRequest]) -> AbstractContextManager[None]:
        return kept_without(", ".join(request.name for request in requests), diagnostics)

    with costs.stage("aovs"):
        with kept(plain):
            if plain:
                also = () if prepared.rolls else planes_of_labels(labels)
                made, planes = aovs_and_planes_of(prepared.scene, plain, prepared.camera, counts, prepared.settings, also)
                found |= made
        if sampling is not None:
            with kept(mattes):
                found |= mattes_of(prepared.scene, mattes, sampling, prepared.assets) if mattes else {}
            with kept(routed):
                found |= light_paths_of_film(prepared.scene, routed, sampling.film) if routed else {}
        with kept(labels):
            if labels and prepared.labelled is not None:
                made, says = labels_of_view(prepared, labels, diagnostics, planes)
                found |= made
    return {request.name: found[request.name] for request in prepared.aovs if request.name in found}, says


def core_facts(scene: CoreScene) -> dict[str, Any]:
    """Return the report's facts about the core."""
    from .. import core

    facts = {"isa": core.isa(), "lanes": core.lanes(), "versions": core.versions(), "features": list(scene.features)}
    return facts if scene.texture_memory is None else facts | {"texture_memory": scene.texture_memory}


class _Watched:
    """The caller's progress callback, which records whether it or a signal asked to stop."""

    def __init__(self, progress: Progress | None, asked: Interruption) -> None:
        self.progress = progress
        self.asked = asked
        self.stopped = False

    def __call__(self, fraction: float, samples: int, rays: int) -> bool:
        if not self.stopped and self.progress is not None and self.progress(fraction, samples, rays) is False:
            self.stopped = True
        return not self.stopped and not self.asked.asked
