"""A stage that is rendered repeatedly: what does not change from one render to the next is kept.

KeptStage follows edits, and drops results of interrupted steps; Scene is what callers use. `render_frames` renders several
frames of one stage, where each reuses what the one before made and time does not change.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, Unpack

from ..errors import SettingsError
from ..render.prepare import composing_settings, prepare
from ..render.render import OnInterrupt, OpenedFrames, rendered_frames, with_setting_names
from ..settings import RenderSettings, with_values
from .steps import CachedSteps, MemoryLimitedSteps, SharedTranslation

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..checkpoints.checkpointing import Checkpointing
    from ..description import SceneDescription
    from ..diagnostics import Diagnostics
    from ..images.image import Image
    from ..render.first_hits import FirstHits
    from ..render.prepare import OpenedStage, Steps
    from ..render.progress import Snapshots
    from ..render.render import Open, Tell
    from ..report.prepared import Prepared
    from ..report.report import Costs
    from ..sampling.sampling import Progress
    from ..settings import RenderSettings
    from ..settings.written import SettingsValues


COMPOSING = ("variants", "load", "mask", "session_layer")
PLAIN = composing_settings(RenderSettings())


class Scene:
    """A stage, given as a Usd.Stage or as the path of one, that stays ready to render.

    >>> scene = primray.Scene("shot.usda")
    >>> first = scene.render(resolution=(32, 18), spp=2)
    >>> scene.stage.GetPrimAtPath("/sun").GetAttribute("inputs:intensity").Set(4.0)
    True
    >>> brighter = scene.render(resolution=(32, 18), spp=2)

    Edits of `stage`, of its layers, or by reloading these are found by USD's notices, whoever makes them. A render equals
    `primray.render(scene.stage, settings)` to the bit, and takes less time where less has changed. Scenes keep what they have
    translated and built in memory, until `close()` or until they are garbage-collected.

    One thread at a time may render, and none may edit the stage until the render's first call of `progress`.
    `composition`: variants, load, mask and session_layer, as in RenderSettings; the same for all renders.
    """

    def __init__(self, stage: str | os.PathLike[str] | Any, **composition: Any) -> None:
        unknown = sorted(composition.keys() - set(COMPOSING))
        if unknown:
            raise SettingsError(f"a scene is composed with {', '.join(COMPOSING)}, not with {unknown[0]}", where=unknown[0])
        self._composition: dict[str, Any] = {name: value for name, value in composition.items() if value is not None}
        self._kept = KeptStage(stage, RenderSettings(**self._composition))

    @property
    def stage(self) -> Any:
        """The Usd.Stage that is rendered, to edit: the given one, unless `composition` asks for another one."""
        return self._kept.opened.stage

    @with_setting_names
    def render(
        self,
        settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
        *,
        progress: Progress | Literal[False] | None = None,
        on_interrupt: OnInterrupt = "raise",
        snapshots: Snapshots | None = None,
        **values: Unpack[SettingsValues],
    ) -> Image:
        """Render the stage as it is now, like primray.render; `snapshots` are those of primray.render_frames."""
        from ..diagnostic_messages import Announcer
        from ..render.progress import shown_progress

        settings = self._composed(with_values(settings, values))
        with shown_progress(progress) as shown:
            tell = Announcer(self._kept.opened.name).tell
            return self._kept.render(settings, shown, on_interrupt, None, () if snapshots is None else (snapshots,), tell)

    @with_setting_names
    def first_hits(
        self,
        settings: RenderSettings = RenderSettings(),  # noqa: B008 - immutable
        **values: Unpack[SettingsValues],
    ) -> FirstHits:
        """Return the AOVs and labelled things of the stage as it is now, without light: those of `render`, to the bit."""
        from ..diagnostic_messages import Announcer

        return self._kept.first_hits(self._composed(with_values(settings, values)), Announcer(self._kept.opened.name).tell)

    def close(self) -> None:
        """Free all that is kept; a later render starts from scratch."""
        self._kept.forget()

    def _composed(self, settings: RenderSettings) -> RenderSettings:
        """Return the settings with the scene's composition, where they say nothing about composition themselves."""
        if composing_settings(settings) == PLAIN and self._composition:
            settings = replace(settings, **self._composition)
        if composing_settings(settings) != self._kept.opened.composed_by:
            raise SettingsError("all renders of a scene must have its composition: variants, load, mask, session_layer")
        return settings


class KeptStage(OpenedFrames):
    """An opened stage and its kept steps. `opened`: the stage, as composed for the settings that it was opened with.

    `is_frugal`: where the process is large, nothing is kept beside the picture that is rendered. `lock`: held by whoever edits
    the stage. `writes_session`: a caller's stage is composed again from its layers, with a session layer to write to.
    """

    def __init__(
        self,
        stage: Any,
        settings: RenderSettings,
        *,
        is_frugal: bool = False,
        lock: AbstractContextManager[object] | None = None,
        writes_session: bool = False,
    ) -> None:
        from ..usd.incremental import StageChanges

        super().__init__(stage, settings)
        self._composition = settings.composition
        self._is_given = self.opened.stage is stage  # a caller's stage, whose session layer primray does not write to
        if self._is_given and writes_session:
            from ..usd import scratch_copy

            self.opened, self._is_given = replace(self.opened, stage=scratch_copy(stage)), False
        self._changes = StageChanges(self.opened.stage)
        self.edits = 0  # taken so far, counting those since the take before as one
        self._steps = MemoryLimitedSteps() if is_frugal else CachedSteps(SharedTranslation(lock))

    @property
    def own_steps(self) -> CachedSteps:
        return self._steps

    def further_steps(self) -> CachedSteps:
        """Return steps for another scene of the stage, which shares its translation and may be prepared in another thread."""
        return CachedSteps(self._steps.translation)

    @property
    def lock(self) -> AbstractContextManager[object]:
        """Whoever edits the stage holds this, where scenes are prepared in other threads."""
        return self._steps.translation.lock

    def is_edited(self) -> bool:
        """Return whether the stage has been edited since a render last took its edits."""
        return self._changes.are_there()

    def forget(self) -> None:
        self._steps.forget()

    @contextmanager
    def steps(self, costs: Costs) -> Iterator[Steps]:
        with super().steps(costs):
            self._catch_up(costs)
            with self._steps.whole():
                yield self._steps

    def prepare(
        self,
        settings: RenderSettings,
        costs: Costs,
        diagnostics: Diagnostics,
        *,
        fingerprinted: bool = False,
        steps: CachedSteps | None = None,
    ) -> Prepared:
        """Prepare a render, as render.prepare does, by its own steps or by `further_steps`."""
        steps = self._steps if steps is None else steps
        with self.lock, OpenedFrames.steps(self, costs):
            self._catch_up(costs)
            steps.edits = self.edits
            stage, opening = self.opened.stage, self.opened.diagnostics
        with steps.whole():
            return prepare(stage, opening, settings, costs, diagnostics, fingerprinted=fingerprinted, steps=steps)

    def first_hits(self, settings: RenderSettings, tell: Tell) -> FirstHits:
        """Return what the camera sees first."""
        from ..diagnostics import Diagnostics
        from ..render.first_hits import first_hits_of_opened
        from ..report.report import Costs

        costs, diagnostics = Costs(), Diagnostics()
        with self.steps(costs) as steps:
            found = first_hits_of_opened(self.opened, settings, costs, diagnostics, steps)
        tell(diagnostics)
        return found

    def translated(self, settings: RenderSettings) -> SceneDescription:
        """Return the stage's translation, which the next picture with these settings is made of."""
        from ..report.report import Costs

        with self.lock:
            self._catch_up(Costs())
            return self._steps.translate(self.opened.stage, settings)[0]

    def _catch_up(self, costs: Costs) -> None:
        """Take the edits since the last render; after edits of the composition, repeat the checks of opening."""
        if not self._is_given:
            from ..usd.stage.composition import follow_session_layers

            follow_session_layers(self.opened.stage)
        self.edits += self._changes.are_there()
        changes = self._changes.take()
        self._steps.translation.changes.add(changes)
        if changes.others:
            from ..diagnostics import Diagnostics
            from ..usd.stage.open import recheck_stage

            told = Diagnostics()
            with costs.stage("open"):
                recheck_stage(self.opened.stage, told, self._composition)
            self.opened = replace(self.opened, diagnostics=told)


def render_frames(
    stage: str | os.PathLike[str] | OpenedStage | Any,
    frames: Iterable[RenderSettings],
    *,
    progress: Progress | Literal[False] | None = None,
    on_interrupt: OnInterrupt = "raise",
    checkpointing: Iterable[Checkpointing | None] = (),
    snapshots: Snapshots | None = None,
) -> Iterator[Image]:
    """Render one stage several times, opening it once (the first report has the time of that).

    >>> frames = [primray.RenderSettings(time_code=t, resolution=(32, 18), spp=2) for t in (1.0, 2.0)]
    >>> [image.report["settings"]["time_code"] for image in primray.render_frames("shot.usda", frames)]
    [1.0, 2.0]

    What does not change from frame to frame is translated and built once, as far as memory allows; the bits are those of
    separate renders. `checkpointing`, where given, has one item a frame; `snapshots` are taken of every frame. All else is
    as for `render`.
    """
    taken = () if snapshots is None else (snapshots,)
    return rendered_frames(
        stage,
        frames,
        progress=progress,
        on_interrupt=on_interrupt,
        checkpointing=checkpointing,
        snapshots=taken,
        opening=_opener(frames),
    )


def quiet_frames(
    stage: str | os.PathLike[str] | OpenedStage | Any,
    frames: Iterable[RenderSettings],
    *,
    progress: Progress | None = None,
    on_interrupt: OnInterrupt = "raise",
    checkpointing: Iterable[Checkpointing | None] = (),
    snapshots: Sequence[Snapshots] = (),
) -> Iterator[Image]:
    """Render frames for callers that show diagnostics and progress themselves: no warnings, no log, no progress bar."""
    return rendered_frames(
        stage,
        frames,
        progress=progress,
        on_interrupt=on_interrupt,
        checkpointing=checkpointing,
        snapshots=snapshots,
        is_quiet=True,
        opening=_opener(frames),
    )


def _opener(frames: Iterable[RenderSettings]) -> Open:
    """Return how to open the stage: a single frame keeps nothing; the length of an iterator is unknown."""
    return OpenedFrames if isinstance(frames, Sequence) and len(frames) == 1 else _open_kept


def _open_kept(stage: Any, settings: RenderSettings) -> OpenedFrames:

    return KeptStage(stage, settings, is_frugal=True)
