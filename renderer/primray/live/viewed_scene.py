"""A stage kept open to be rendered repeatedly: with other cameras, other variants, and changed files.

A move of the camera is one attribute of the session layer: everything that does not depend on it is kept between renders. Mouse
drags, as fractions of the picture's height, turn the camera around a target point.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import usd
from ..arrays import Doubles
from ..camera import Camera, Projection
from ..description.placement import Box
from ..diagnostics import Diagnostics
from ..incremental.scene import KeptStage
from ..render.progress import picture_so_far
from ..render.render import picture_of
from ..report.report import Costs
from ..settings import RenderSettings

if TYPE_CHECKING:
    from ..camera import Camera
    from ..description.placement import Box
    from ..images.image import Image
    from ..report.prepared import Prepared
    from ..sampling.sampling import Sampling


TURN = math.pi  # radians for a drag over the picture's height
STEEPEST = math.cos(math.radians(89.5))  # least dot product of the camera's up axis and the stage's: below 0 it is upside down
ROOM = 1.1  # radius of the framed sphere over that of the box
NEAREST = 1e-3  # least distance to the target, as a fraction of the scene's size


@dataclass(frozen=True, eq=False)
class Orbit:
    """A camera that orbits a target. `rotation` (3, 3): the camera's right, up and backward axes in the world, as unit
    columns."""

    target: Doubles  # (3,) world
    rotation: Doubles
    distance: float  # scene units, to the target
    up: Doubles  # (3,) world: the stage's up axis
    zoom: float = 1.0  # of an orthographic camera's window

    @property
    def world_from_camera(self) -> Doubles:
        """Matrix (4, 4), column-vector."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.target + self.rotation[:, 2] * self.distance
        return matrix

    def tumbled(self, across: float, down: float) -> Orbit:
        """Return the orbit turned about the target: objects follow the mouse. The camera never turns over."""
        turned = _rotation(self.up, -TURN * across) @ self.rotation
        raised = _rotation(turned[:, 0], -TURN * down) @ turned
        upright = min(float(turned[:, 1] @ self.up) - 1e-12, STEEPEST)
        return replace(self, rotation=raised if raised[:, 1] @ self.up >= upright else turned)

    def panned(self, across: float, down: float, camera: Camera) -> Orbit:
        """Return the orbit with the target moved against the mouse, so that objects follow it."""
        height = camera.window[3] - camera.window[2]
        if camera.projection is Projection.PERSPECTIVE:
            height *= self.distance
        right, up = self.rotation[:, 0], self.rotation[:, 1]
        return replace(self, target=self.target + height * (down * up - across * right))

    def dollied(self, steps: float, camera: Camera) -> Orbit:
        """Return the orbit moved towards the target, by a factor of e per step; an orthographic window shrinks instead."""
        factor = math.exp(-steps)
        if camera.projection is Projection.ORTHOGRAPHIC:
            return replace(self, zoom=self.zoom * factor)
        return replace(self, distance=self.distance * factor)

    def framed(self, box: Box, camera: Camera) -> Orbit:
        """Return the orbit in the same direction with the whole box in the picture."""
        low, high = (np.asarray(corner, np.float64) for corner in box)
        radius = max(float(np.linalg.norm(high - low)) / 2, 1e-9)
        left, right, bottom, top = camera.window
        side = min(right - left, top - bottom)
        target = (low + high) / 2
        if camera.projection is Projection.ORTHOGRAPHIC:
            zoom = self.zoom * ROOM * 2 * radius / side
            return replace(self, target=target, zoom=zoom, distance=max(self.distance, 2 * radius))
        return replace(self, target=target, distance=ROOM * radius / math.sin(math.atan(side / 2)))


def orbit_of(camera: Camera, box: Box | None, z_up: bool) -> Orbit:
    """Return the orbit of a camera about the point on its axis that is nearest to the centre of the scene's box."""
    matrix = np.asarray(camera.world_from_camera, np.float64)
    up = np.array([0.0, 0.0, 1.0] if z_up else [0.0, 1.0, 0.0])
    rotation, eye = matrix[:3, :3].copy(), matrix[:3, 3]
    distance = camera.focus_distance if 0 < camera.focus_distance < math.inf else 1.0
    if box is not None:
        low, high = (np.asarray(corner, np.float64) for corner in box)
        size = float(np.linalg.norm(high - low))
        ahead = float((eye - (low + high) / 2) @ rotation[:, 2])
        distance = max(ahead, NEAREST * size, 1e-9) if ahead > 0 or size > 0 else distance
    return Orbit(eye - rotation[:, 2] * distance, rotation, distance, up)


def _rotation(axis: Doubles, angle: float) -> Doubles:
    """Return the rotation (3, 3) about a unit axis (Rodrigues' formula)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: Doubles = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)
    return turned


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
        orbit, nearest = self.orbit, usd.nearest_of(self.orbit.distance)
        return usd.place_camera(self._kept.opened.stage, orbit.world_from_camera, self._authored, orbit.zoom, nearest)

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
