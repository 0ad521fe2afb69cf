"""SceneDescription: shapes, their placement, lights, the camera and the frame as one value; the pixels rendered relative to the
frame; and whether display views of the picture need alpha."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from ..aovs import AovRequest
from ..arrays import Doubles
from ..camera import Camera, Projection
from ..color.color_space import REC709, ColorSpace
from ..settings.stage_settings import NOTHING_ASKED, StageSettings
from .fog import Fog
from .geometry import Shape
from .lighting import NO_LINKS, Light, LightType, Linked, half_extent
from .motion import CameraMotion, Exposure, MotionSteps
from .picture_file import PLAIN, PictureFile
from .placement import Placement
from .shading import Surface
from .volumes import VolumeEmission, VolumeMedium


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
    # (staging.py).
    may_need_light: bool = False
    anchor: Camera | None = None  # camera near which lengths are measured; None: the one that is rendered
    fog: Fog | None = None
    media: tuple[VolumeMedium, ...] = ()  # volumes of voxels; their extinctions add where they overlap
    volume_emissions: tuple[VolumeEmission, ...] = ()  # light of voxels
    lights_apart: tuple[str, ...] = ()  # paths of lights that are groups of their own, for the output `lights`

    @property
    def volumes(self) -> tuple[VolumeMedium | VolumeEmission, ...]:
        return (*self.media, *self.volume_emissions)

    @property
    def frame(self) -> Frame:
        if self.pixels is None:
            return whole_frame(*self.resolution, self.pixel_aspect_ratio)
        return Frame(self.resolution, self.pixels, self.pixel_aspect_ratio)


Window = tuple[float, float, float, float]


@dataclass(frozen=True)
class PixelWindow:
    """Rectangle of pixels whose first is (x, y), counted right and down from the frame's upper left corner."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class Frame:
    resolution: tuple[int, int]  # width and height of the whole frame: an EXR's display window
    pixels: PixelWindow  # rendered pixels: an EXR's data window
    pixel_aspect_ratio: float = 1.0  # width of a pixel over its height

    @property
    def size(self) -> tuple[int, int]:
        return self.pixels.width, self.pixels.height

    @property
    def is_whole(self) -> bool:
        return self.pixels == PixelWindow(0, 0, *self.resolution)


def whole_frame(width: int, height: int, pixel_aspect_ratio: float = 1.0) -> Frame:
    return Frame((width, height), PixelWindow(0, 0, width, height), pixel_aspect_ratio)


def pixels_within(window: Window, resolution: tuple[int, int]) -> PixelWindow:
    """Return the pixels whose centres are within (left, bottom, right, top), where (0, 0) is the frame's lower left corner and
    (1, 1) its upper right (UsdRenderSettingsBase, dataWindowNDC).

    A centre on the left or upper edge is inside, one on the right or lower edge is not, so adjacent windows share no pixel (the
    rasterizers' rule that the schema refers to). The result may be empty.
    """
    left, bottom, right, top = window
    width, height = resolution
    x0, x1 = _first_centre(left, width), _first_centre(right, width)
    y0, y1 = _first_centre(1.0 - top, height), _first_centre(1.0 - bottom, height)
    return PixelWindow(x0, y0, max(x1 - x0, 0), max(y1 - y0, 0))


def _first_centre(edge: float, count: int) -> int:
    """Return the first pixel whose centre is at or after `edge`, to within the rounding of the edge as a float."""
    at = edge * count - 0.5
    nearest = round(at)
    return nearest if abs(at - nearest) <= max(abs(edge), 1.0) * count * 2.0**-23 else math.ceil(at)


def with_larger_pixels(description: SceneDescription, size: float) -> SceneDescription:
    """Return the description with pixels `size` times as wide and high, at least one, that fill the same window of the camera.

    Their shape differs from that of the pixels of before by what rounding to whole pixels leaves.
    """
    width, height = (max(1, round(side / size)) for side in description.resolution)
    across, down = description.resolution[0] / width, description.resolution[1] / height
    pixels = description.pixels
    if pixels is not None:
        left, top = math.floor(pixels.x / across), math.floor(pixels.y / down)
        right, bottom = math.ceil((pixels.x + pixels.width) / across), math.ceil((pixels.y + pixels.height) / down)
        pixels = PixelWindow(left, top, right - left, bottom - top)
    aspect = description.pixel_aspect_ratio * across / down
    return replace(description, resolution=(width, height), pixels=pixels, pixel_aspect_ratio=aspect)


def is_lit_behind(description: SceneDescription) -> bool:
    """Return whether a dome, or the extent of another light visible to the camera, is in the frame.

    If so, display views are written without alpha: light without coverage cannot be represented in a PNG, whose alpha is
    straight. The answer follows from lights and camera alone, so that samples never decide which channels a file has.
    """
    return any(_may_be_seen(light, description.camera) for light in description.lights)


def _may_be_seen(light: Light, camera: Camera) -> bool:
    if not light.visible_to_camera or not any(light.emission):
        return False
    if light.type is LightType.DOME:
        return True
    if light.type in (LightType.POINT, LightType.LINE) or (light.type is LightType.DISTANT and light.angle_deg <= 0):
        return False
    if camera.distortion is not None:
        return True
    return _may_be_in_frame(_light_corners(light, camera), camera)


def _light_corners(light: Light, camera: Camera) -> Doubles:
    """Return the corners (8, 3) of a box around the light, in world space."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    m = np.asarray(light.world_from_light, np.float64)
    if light.type is LightType.DISTANT:
        eye, z = camera.world_from_camera[:3, 3], m[:3, 2] / np.linalg.norm(m[:3, 2])
        half = math.tan(math.radians(min(light.angle_deg / 2, 89.0)))
        distance = 1e6
        return np.asarray(eye + distance * (z + half * signs), np.float64)
    return np.asarray((signs * half_extent(light)) @ m[:3, :3].T + m[:3, 3], np.float64)


def _may_be_in_frame(corners: Doubles, camera: Camera) -> bool:
    """Return whether the corners are not all on the outer side of one plane of the view frustum."""
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    x, y, z = (corners @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]).T
    left, right, bottom, top = camera.window
    width = -z if camera.projection is Projection.PERSPECTIVE else np.ones_like(z)
    outside = (z >= 0, x < left * width, x > right * width, y < bottom * width, y > top * width)
    return not any(bool(np.all(plane)) for plane in outside)


def has_light(description: SceneDescription) -> bool:
    """Return whether anything emits: a light, a surface, a volume or fog. Textures and patterns are taken to emit somewhere."""
    emissions = [light.emission for light in description.lights]
    emissions += [shape.light.emission for shape in description.shapes if shape.light is not None and shape.light.own_color]
    emissions += [surface.emissive_color for surface in description.surfaces]
    emissions += [surface.volume.emission for surface in description.surfaces if surface.volume is not None]
    emissions += [volume.emission for volume in description.volume_emissions]
    if description.fog is not None:
        emissions.append(description.fog.emission)
    return any(map(any, emissions)) or any("emissive_color" in surface.varying for surface in description.surfaces)


def without_emission(description: SceneDescription, kept: Collection[str] = ()) -> SceneDescription:
    """Return the scene with no light of surfaces, shapes, volumes and fog; only shapes that are lights of `kept` paths shine.

    Lights are left as they are. Where such a shape stays, all surfaces keep their emission, which it may shine with.
    """
    shapes = tuple(
        replace(shape, light=None) if shape.light is not None and shape.light.path not in kept else shape
        for shape in description.shapes
    )
    surfaces = description.surfaces
    if all(shape.light is None for shape in shapes):
        surfaces = tuple(
            replace(
                surface,
                emissive_color=(0.0, 0.0, 0.0),
                inputs=tuple(pair for pair in surface.inputs if pair[0] != "emissive_color"),
            )
            for surface in surfaces
        )
    fog = None if description.fog is None else replace(description.fog, emission=(0.0, 0.0, 0.0))
    return replace(description, surfaces=surfaces, shapes=shapes, volume_emissions=(), fog=fog)
