"""Render passes: each adds samples of a scene to a film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..settings import RenderSettings
from .core_errors import raise_as_ours
from .core_inputs import integrator_settings
from .film import Film, uniform_ends
from .isa_class import lanes, module
from .limits import threads
from .scene import CoreScene, Splits

Progress = Callable[[float], bool | None]  # called with the fraction of the pass that is done


@dataclass(frozen=True)
class Pass:
    """Result of a render pass."""

    interrupted: bool
    seconds: float
    busy_lanes: int
    shaded_lanes: int


def choose_splits(scene: CoreScene, settings: RenderSettings) -> Splits:
    """Return `CoreScene.splits`."""
    return scene.splits(settings)


def render_pass(
    scene: CoreScene,
    film: Film,
    ends: npt.NDArray[np.uint32],
    splits: Splits,
    settings: RenderSettings,
    progress: Progress | None = None,
) -> Pass:
    """Render until every tile's sequences (R, tiles) are at `ends`, or until `progress` returns False or Ctrl-C is pressed.

    The film is valid then, and another pass continues from there to the same bits.
    """
    guide, caustics = scene.guide(settings, splits), scene.caustics(settings)
    if guide is not None and guide.alone:
        caustics = None
    asked = integrator_settings(
        module(),
        settings,
        threads=threads(settings),
        seed=settings.seed,
        splits=splits.paths,
        light_samples=splits.lights,
        screen_block=settings.screen_block,
        guide=guide,
        caustics=caustics,
        routes=scene.route_tables(settings),
        **({} if settings.clamp_indirect is None else {"clamp_indirect": scene.clamp_of(settings.clamp_indirect)}),
    )
    to = np.ascontiguousarray(ends, np.uint32)
    try:
        done = module().render_pass(scene._scene, film._film, to, asked, lanes=lanes(), progress=progress)
    except module().CoreError as error:
        raise_as_ours(error)
    return Pass(bool(done.interrupted), float(done.seconds), int(done.busy_lanes), int(done.shaded_lanes))


def render(scene: CoreScene, settings: RenderSettings, progress: Progress | None = None) -> Film:
    """Return a film of one uniform pass of `settings.spp` samples, without measuring the error."""
    film = Film(scene, settings=settings)
    splits = choose_splits(scene, settings)
    render_pass(scene, film, uniform_ends(film, settings.most_samples), splits, settings, progress)
    return film


class Recording:
    """All rays of a single-threaded render, in order, for tracing again with Embree alone (for the benchmark; takes memory)."""

    def __init__(self, scene: CoreScene, settings: RenderSettings) -> None:
        asked = integrator_settings(module(), settings, seed=settings.seed)
        self._recording = module().Recording(scene._scene, settings.most_samples, asked, lanes())

    def replay_s(self) -> float:
        """Return the seconds that one thread takes to trace the rays, as packets or single rays as in the render."""
        return float(self._recording.replay_seconds())
