"""The scene as one value: shapes, where they stand, lights and the camera."""

from __future__ import annotations

from dataclasses import dataclass

from ..aov_names import AovRequest
from ..arrays import Doubles
from ..camera import Camera
from ..color.color_space import REC709, ColorSpace
from ..settings.in_stage import NOTHING_ASKED, StageSettings
from .frame import Frame, PixelWindow, whole_frame
from .geometry import Shape
from .lighting import NO_LINKS, Light, Linked
from .motion import CameraMotion, Exposure, MotionSteps
from .picture_file import PLAIN, PictureFile
from .placement import Placement
from .shading import Surface


@dataclass(frozen=True, slots=True)  # there may be millions
class Placed:
    """One shape with its matrix: to the world when static, to the prototype's space inside a Prototype."""

    shape: int
    matrix: Doubles  # (4, 4)
    instance: str = ""  # what the instance is called that it is the only one of; where an AOV asks for instances


@dataclass(frozen=True)
class Prototype:
    """What is stored once and placed many times: shapes, or placements of prototypes that have shapes (two levels at most).

    Nested instancing is multiplied out by translation, up to a budget (usd/walking/instances.py).
    """

    path: str
    shapes: tuple[Placed, ...]
    placements: tuple[Placement, ...] = ()


@dataclass(frozen=True)
class SceneDescription:
    shapes: tuple[Shape, ...]
    surfaces: tuple[Surface, ...]
    static: tuple[Placed, ...]  # shapes used once, world_from_object
    prototypes: tuple[Prototype, ...]
    placements: tuple[Placement, ...]
    lights: tuple[Light, ...]
    camera: Camera
    resolution: tuple[int, int]  # width, height
    up_axis: str
    meters_per_unit: float
    time_code: float | None  # None: USD's default time
    aovs: tuple[AovRequest, ...] = ()
    pixels: PixelWindow | None = None  # those that are rendered; None: the whole of `resolution`
    pixel_aspect_ratio: float = 1.0
    linked: Linked = NO_LINKS
    rendering_space: ColorSpace = REC709
    exposure: Exposure | None = None  # None: an instant, at which nothing moves
    camera_motion: CameraMotion | None = None
    motion_steps: tuple[MotionSteps, ...] = ()  # of all that moves
    instances: tuple[str, ...] = ()  # those that shapes in native prototypes are named by, where AOVs are asked for
    file: PictureFile = PLAIN  # what the stage's product asks of the EXR
    asked: StageSettings = NOTHING_ASKED  # settings of the render that the stage asks for
    # There are no lights and surfaces glow: a small picture decides whether a studio light is added (staging/judged_light.py).
    may_need_light: bool = False

    @property
    def frame(self) -> Frame:
        if self.pixels is None:
            return whole_frame(*self.resolution, self.pixel_aspect_ratio)
        return Frame(self.resolution, self.pixels, self.pixel_aspect_ratio)
