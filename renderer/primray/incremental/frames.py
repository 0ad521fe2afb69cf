"""Rendering of several frames of one stage, where each reuses what the one before made and time does not change."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal

from ..render.render import OnInterrupt, OpenedFrames, rendered_frames
from ..settings import RenderSettings

if TYPE_CHECKING:
    from ..checkpoints.checkpointing import Checkpointing
    from ..images.image import Image
    from ..render.prepare import OpenedStage
    from ..render.render import Open
    from ..render.snapshots import Snapshots
    from ..sampling.sampling import Progress


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
    from .scene import KeptStage

    return KeptStage(stage, settings, is_frugal=True)
