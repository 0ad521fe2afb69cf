"""A stage kept open to be rendered repeatedly: with other cameras, other variants, and changed files.

A move of the camera is one attribute of the session layer: everything that does not depend on it is kept between renders.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from .. import usd
from ..diagnostics import Diagnostics
from ..incremental.scene import KeptStage
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
    """A picture in progress or finished: samples of its pixels, its error, diagnostics."""

    image: Image
    samples: float  # a pixel, on average
    relmse: tuple[float, float, float] | None  # estimate and 95 % interval
    diagnostics: list[dict[str, str]]
    finished: bool


@dataclass(frozen=True)
class Size:
    """Size of a render: its resolution as a fraction of the full one, and samples per pixel."""

    scale: float
    spp: int


Answer = Callable[[], bool]


class ViewedScene:
    """The stage at `path`; used by one thread at a time.

    Raises PrimrayErrors where it cannot be opened or rendered; its state is then that of before.
    """

    def __init__(self, path: str, settings: RenderSettings) -> None:
        self.path = path
        self.settings = settings  # without the camera and variants chosen since
        self.camera = settings.camera
        self.variants = settings.variants
        self.orbit: Orbit | None = None  # None: the camera is as authored
        self.bounds: Box | None = None  # (3,) low and high corner of the scene
        self.through: Camera | None = None  # camera of the last picture
        self._authored: Camera | None = None
        self._kept: KeptStage | None = None
        self.cameras: list[str] = []
        self.variant_sets: list[dict[str, Any]] = []
        self._z_up = False
        self.read_ns = 0  # when its files were read last

    @property
    def authored_path(self) -> str:
        """Path of the stage's camera that the view started from, wherever it was moved to; "": no camera of the stage."""
        return "" if self._authored is None else self._authored.path

    def open(self, variants: tuple[str, ...] | None = None) -> None:
        """Compose the stage, with other variants if given."""
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
        """Reload the stage after these files (absolute paths) have changed."""
        usd.reload_layers(self.path, files)
        self.open()

    def choose(self, prim: str, of_set: str, name: str) -> None:
        """Choose a variant, stronger than all earlier choices."""
        choice = f"{prim}:{of_set}="
        self.open((*(v for v in self.variants if not v.startswith(choice)), choice + name))

    def files(self) -> set[str]:
        """Return absolute paths of the files that the picture may change with."""
        session_layer = self.settings.session_layer
        found = usd.files_to_watch(self.path) | (usd.files_to_watch(session_layer) if session_layer else set())
        if self._kept is not None:
            for layer in (
                usd.layer_files(self._kept.opened.stage) - found
            ):  # files that only the session's expression variables lead to
                found |= usd.files_to_watch(layer)
        return found

    def look_through(self, camera: str | None) -> None:
        """View through a camera of the stage (None: as the settings say), as authored."""
        self.camera = camera if camera is not None else self.settings.camera
        self.orbit = self._authored = None

    def reset(self) -> None:
        """Return to the viewed camera as authored."""
        self.orbit = None

    def move(self, change: Callable[[Orbit, Camera], Orbit]) -> None:
        """Move the camera from where it is; does nothing before the first picture."""
        if self._authored is None or self.through is None:  # it is about to be rendered for the first time
            return
        self.orbit = change(self.orbit or orbit_of(self._authored, self.bounds, self._z_up), self.through)
        self._place()

    def _place(self) -> str | None:
        """Write the moved camera to the stage and return its path; None where the camera is as authored."""
        if self.orbit is None or self._authored is None or self._kept is None:
            return None
        return usd.place_camera(self._kept.opened.stage, self.orbit.world_from_camera, self._authored, self.orbit.zoom)

    def render(self, size: Size, show: Callable[[View], None], is_due: Answer, continues: Answer) -> bool:
        """Render until all samples are taken, and return True, or False once `goes_on` answers False.

        `show` gets the picture whenever one `is_due`, and the last one.
        """
        from ..sampling.sampling import Sampling

        prepared, diagnostics, costs = self._prepare(size)
        sampling = Sampling.begin(prepared.scene, prepared.settings)
        sampling.schedule = replace(sampling.schedule, first_look=True)  # something to see soon
        while not sampling.run(lambda *_: continues(), lambda: sampling.done > 0 and is_due()):
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
