"""SceneDescription: shapes, their placement, lights, the camera and the frame as one value."""

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
    """Shape with its matrix: world_from_object in SceneDescription.static, prototype_from_object inside a Prototype."""

    shape: int
    matrix: Doubles  # (4, 4)
    instance: str = ""  # name of the instance that consists of this shape alone; if an AOV shows instances


@dataclass(frozen=True)
class Prototype:
    """Geometry stored once and placed many times: shapes, or placements of prototypes that have shapes (at most two levels).

    Deeper nesting is multiplied out by translation, up to a budget (usd/instancing/instances.py).
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
    pixels: PixelWindow | None = None  # rendered pixels; None: all of `resolution`
    pixel_aspect_ratio: float = 1.0
    linked: Linked = NO_LINKS
    rendering_space: ColorSpace = REC709
    exposure: Exposure | None = None  # None: an instant, without motion
    camera_motion: CameraMotion | None = None
    motion_steps: tuple[MotionSteps, ...] = ()  # report entries of all moving things
    instances: tuple[str, ...] = ()  # names of instances with shapes of native prototypes, if an AOV shows instances
    file: PictureFile = PLAIN  # EXR options of the stage's render product
    asked: StageSettings = NOTHING_ASKED  # render settings from the stage
    # Surfaces emit and there are no lights: a small test render decides whether a studio light is added
    # (staging/judged_light.py).
    may_need_light: bool = False

    @property
    def frame(self) -> Frame:
        if self.pixels is None:
            return whole_frame(*self.resolution, self.pixel_aspect_ratio)
        return Frame(self.resolution, self.pixels, self.pixel_aspect_ratio)
