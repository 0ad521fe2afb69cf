"""A stage that is kept open to be rendered again and again: other cameras, other variants, files that have changed.

A move of the camera is one attribute of the session layer: all that does not depend on it stays from one render to the next.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from .. import usd
from ..diagnostics import Diagnostics
from ..keeping.kept_stage import KeptStage
from ..render.render import picture_of
from ..render.snapshots import picture_so_far
from ..report.report import Costs
from ..settings import RenderSettings
from .orbit import Orbit, orbit_of

if TYPE_CHECKING:
    from ..camera import Camera
    from ..description.placement import Box
    from ..images.image import Image
    from ..report.prepared import Prepared
    from ..sampling.sampling import Sampling


@dataclass(frozen=True)
class View:
    """A picture under way or finished: how many samples its pixels have, its error by then, what there is to tell."""

    image: Image
    samples: float  # a pixel, on average
    relmse: tuple[float, float, float] | None  # estimate and 95 % interval
    diagnostics: list[dict[str, str]]
    finished: bool


@dataclass(frozen=True)
class Size:
    """Of a render: its resolution as a part of the whole one's, and samples a pixel."""

    scale: float
    spp: int


Answer = Callable[[], bool]


class ViewedScene:
    """Of the stage at `path`; used by one thread at a time. PrimrayErrors where it cannot be opened or rendered, and it stays
    as it was before."""

    def __init__(self, path: str, settings: RenderSettings) -> None:
        self.path = path
        self.settings = settings  # without what was chosen since: camera and variants
        self.camera = settings.camera
        self.variants = settings.variants
        self.orbit: Orbit | None = None  # None: the camera stands where its author left it
        self.bounds: Box | None = None  # (3,) low and high corner of what is there
        self.through: Camera | None = None  # what was looked through last
        self._authored: Camera | None = None
        self._kept: KeptStage | None = None
        self.cameras: list[str] = []
        self.variant_sets: list[dict[str, Any]] = []
        self._z_up = False
        self.read_ns = 0  # when its files were read last

    @property
    def authored_path(self) -> str:
        """Of the camera that is looked through, wherever it was moved to; "": none of the stage's."""
        return "" if self._authored is None else self._authored.path

    def open(self, variants: tuple[str, ...] | None = None) -> None:
        """Compose the stage, with other choices of variants if they are given."""
        chosen = self.variants if variants is None else variants
        self.read_ns = time.time_ns()
        kept = KeptStage(self.path, replace(self.settings, variants=chosen))
        opened = kept.opened
        facts = usd.stage_facts(opened.stage)
        self._kept, self.variants = kept, chosen
        self.cameras = [path for path in usd.camera_paths(opened.stage) if not usd.is_session_camera(path)]
        self.variant_sets, self._z_up = facts["variants"], facts["up_axis"] == "Z"
        if self._authored is not None and self._authored.path and not usd.has_camera(opened.stage, self._authored.path):
            self.camera = self.settings.camera if self.camera == self._authored.path else self.camera
            self.orbit = self._authored = None
        self._place()

    def read_anew(self, files: Collection[str]) -> None:
        """After these files (absolute paths) have changed."""
        usd.read_anew(self.path, files)
        self.open()

    def choose(self, prim: str, of_set: str, name: str) -> None:
        """A variant, stronger than all that was chosen before."""
        choice = f"{prim}:{of_set}="
        self.open((*(v for v in self.variants if not v.startswith(choice)), choice + name))

    def files(self) -> set[str]:
        """Absolute paths of those that the picture may change with."""
        session_layer = self.settings.session_layer
        found = usd.files_to_watch(self.path) | (usd.files_to_watch(session_layer) if session_layer else set())
        if self._kept is not None:
            for layer in usd.layer_files(self._kept.opened.stage) - found:  # what the session's expression variables lead to
                found |= usd.files_to_watch(layer)
        return found

    def look_through(self, camera: str | None) -> None:
        """A camera of the stage (None: as the settings say), as its author left it."""
        self.camera = camera if camera is not None else self.settings.camera
        self.orbit = self._authored = None

    def reset(self) -> None:
        """The camera that is looked through, as its author left it."""
        self.orbit = None

    def move(self, change: Callable[[Orbit, Camera], Orbit]) -> None:
        """From where the camera stands. There has to be a picture already."""
        if self._authored is None or self.through is None:  # it is about to be rendered for the first time
            return
        self.orbit = change(self.orbit or orbit_of(self._authored, self.bounds, self._z_up), self.through)
        self._place()

    def _place(self) -> str | None:
        """The path of the camera that has been moved; None where it stands as its author left it."""
        if self.orbit is None or self._authored is None or self._kept is None:
            return None
        return usd.place_camera(self._kept.opened.stage, self.orbit.world_from_camera, self._authored, self.orbit.zoom)

    def render(self, size: Size, show: Callable[[View], None], is_due: Answer, goes_on: Answer) -> bool:
        """Until all samples are taken: True; or until `goes_on` answers False. `show` gets the picture whenever one `is_due`,
        and the last."""
        from ..sampling.sampling import Sampling

        prepared, diagnostics, costs = self._prepare(size)
        sampling = Sampling.begin(prepared.scene, prepared.settings)
        sampling.schedule = replace(sampling.schedule, first_look=True)  # something to see soon
        while not sampling.run(lambda *_: goes_on(), lambda: sampling.done > 0 and is_due()):
            show(_view(picture_so_far(prepared, sampling), sampling, diagnostics, False))
        if sampling.stop is not None and sampling.stop.reason == "interrupted":
            return False
        show(_view(picture_of(prepared, sampling, costs, diagnostics), sampling, diagnostics, True))
        return True

    def _prepare(self, size: Size) -> tuple[Prepared, Diagnostics, Costs]:
        if self._kept is None:
            self.open()
        assert self._kept is not None
        moved = self._place()
        settings = replace(
            self.settings,
            camera=moved or self.camera,
            variants=self.variants,
            resolution_scale=self.settings.resolution_scale * size.scale,
            spp=size.spp,
        )
        costs, diagnostics = Costs(), Diagnostics()
        prepared = self._kept.prepare(settings, costs, diagnostics)
        self.through, self.bounds = prepared.camera, prepared.scene.bounds
        if moved is None:
            self._authored = prepared.camera
        return prepared, diagnostics, costs


def _view(image: Image, sampling: Sampling, diagnostics: Diagnostics, finished: bool) -> View:
    last = sampling.curve.last
    relmse = None if last is None else (last.error.relmse.value, last.error.relmse.low, last.error.relmse.high)
    return View(image, sampling.mean_samples(), relmse, [d.as_json() for d in diagnostics], finished)
