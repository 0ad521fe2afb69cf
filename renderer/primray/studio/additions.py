"""Studio light, dome, ground and camera orbit of the settings, added to a description.

A small test render decides whether a stage with emissive surfaces but no lights needs the studio light. An estimate from powers
and areas would miss occlusion and textures of the emission. The test render takes a few thousand samples of a scene built at
its size; only stages with emission and without lights pay for it. Its seed, size and samples are fixed, so that all processes
and machines decide alike.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Doubles, Floats
from ..description import Camera, CameraMotion, Light, LightType, Mesh, Placed, SceneDescription, Surface, TextureFile
from ..description.shading import CameraSight
from ..diagnostics import Diagnostics
from ..errors import SettingsError
from ..settings import Ground, RenderSettings, StudioLight
from ..textures.texture_set import LIGHT_LEFT_OUT
from ..usd import framed_bounds
from ..usd.lights.default_light import KEY, STUDIO, default_lights

if TYPE_CHECKING:
    from ..core import CoreScene


DOME, GROUND = "primray:dome", "primray:ground"
GROUND_ALBEDO = 0.18  # mid-grey
GROUND_SIZE = 50.0  # half the ground's width over the scene's radius: its edges are close to the horizon
# The ground's distance below the scene over the scene's radius, so that flat objects on it are not coplanar with it.
GROUND_GAP = 1e-5


def with_requested_additions(
    description: SceneDescription, settings: RenderSettings, diagnostics: Diagnostics
) -> SceneDescription:
    """Return the description with what the settings add; the same object if they add nothing."""
    if settings.orbit_deg % 360 != 0:
        description = _orbited(description, settings.orbit_deg, diagnostics)
    if settings.dome is not None:
        description = _with_dome(description, settings, diagnostics)
    elif settings.dome_rotation % 360 != 0 or not settings.dome_visible:
        description = _with_adjusted_domes(description, settings, diagnostics)
    if settings.ground is not None:
        description = _with_ground(description, settings.ground, diagnostics)
    if settings.background is not None:
        description = _without_visible_domes(description, diagnostics)
    return description


def _up(description: SceneDescription) -> int:
    return 2 if description.up_axis == "Z" else 1


def _turned(degrees: float, up: int) -> Doubles:
    """Return the rotation (4, 4) about the up axis, counterclockwise as seen from above."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    first, second = ((2, 0), (0, 1))[up - 1]  # y-up: z turns to x; z-up: x turns to y
    m = np.eye(4)
    m[first, first] = m[second, second] = c
    m[second, first], m[first, second] = s, -s
    return m


def _orbited(description: SceneDescription, degrees: float, diagnostics: Diagnostics) -> SceneDescription:
    """Rotate the camera about the scene's centre; the studio light rotates with it, lights of the stage do not."""
    up = _up(description)
    low, high = framed_bounds(description, up)
    turned, middle = _turned(degrees, up), (low + high) / 2
    turned[:3, 3] = middle - turned[:3, :3] @ middle

    def around(camera: Camera) -> Camera:
        return replace(camera, world_from_camera=turned @ camera.world_from_camera)

    camera, motion = around(description.camera), description.camera_motion
    if motion is not None:
        motion = CameraMotion(motion.times, tuple(map(around, motion.cameras)))
    lights = description.lights
    if any(light.path == STUDIO for light in lights):
        studio = iter(default_lights(camera, up == 2))
        lights = tuple(next(studio) if light.path in (STUDIO, KEY) else light for light in lights)
    diagnostics.add("staging", camera.path, f"The camera is rotated by {degrees:g} degrees about the scene's centre.")
    return replace(description, camera=camera, camera_motion=motion, lights=lights)


def _with_dome(description: SceneDescription, settings: RenderSettings, diagnostics: Diagnostics) -> SceneDescription:
    assert settings.dome is not None
    if not os.path.isfile(settings.dome):
        raise SettingsError(f"the dome's image does not exist: {settings.dome}", where="dome", code="asset-missing")
    up = _up(description)
    frame = np.eye(4)
    if up == 2:  # as DomeLight_1 with poleAxis Z
        frame[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    texture = TextureFile(os.path.abspath(settings.dome), "auto", target=description.rendering_space)
    dome = Light(
        DOME,
        LightType.DOME,
        _turned(settings.dome_rotation, up) @ frame,
        (1.0, 1.0, 1.0),
        texture=texture,
        visible_to_camera=settings.dome_visible,
    )
    replaced = [light.path for light in description.lights if light.type is LightType.DOME and light.path != STUDIO]
    kept = tuple(light for light in description.lights if light.type is not LightType.DOME)
    instead = f", in place of {', '.join(replaced)}" if replaced else ""
    message = f"A dome with {os.path.basename(settings.dome)} lights the stage{instead}, as requested."
    if any(light.path == STUDIO for light in description.lights):
        message += " The studio light's key light stays; the dome replaces its surroundings."
    diagnostics.add("staging", "", message)
    return replace(description, lights=(*kept, dome))


def _with_adjusted_domes(description: SceneDescription, settings: RenderSettings, diagnostics: Diagnostics) -> SceneDescription:
    """Rotate the stage's domes about the up axis, and hide them from the camera, as the settings ask."""
    turned = _turned(settings.dome_rotation, _up(description))
    found = [light for light in description.lights if light.type is LightType.DOME and light.path != STUDIO]
    if not found:
        diagnostics.add("staging", "", "There is no dome to rotate or hide: neither the stage nor the settings have one.")
        return description

    def changed(light: Light) -> Light:
        motion = light.motion
        if motion is not None:
            motion = replace(motion, matrices=turned @ motion.matrices)
        seen = light.visible_to_camera and settings.dome_visible
        return replace(light, world_from_light=turned @ light.world_from_light, motion=motion, visible_to_camera=seen)

    made = dict.fromkeys(light.path for light in found)
    deeds = [f"rotated by {settings.dome_rotation:g} degrees"] if settings.dome_rotation % 360 != 0 else []
    deeds += [] if settings.dome_visible else ["hidden from the camera"]
    are = "is" if len(made) == 1 else "are"
    diagnostics.add("staging", "", f"{', '.join(made)} {are} {' and '.join(deeds)}, as requested.")
    lights = tuple(changed(light) if light.path in made else light for light in description.lights)
    return replace(description, lights=lights)


def require_dome(description: SceneDescription, settings: RenderSettings, diagnostics: Diagnostics) -> None:
    """Raise SettingsError if the requested dome was left out because its image could not be read."""
    if settings.dome is None or any(light.path == DOME for light in description.lights):
        return
    why = next((d.message for d in diagnostics if d.prim_path == DOME), "it cannot be read").removeprefix(f"{LIGHT_LEFT_OUT}: ")
    raise SettingsError(f"the dome's image cannot be used: {why}", where="dome", code="texture-unreadable")


def _with_ground(description: SceneDescription, ground: Ground, diagnostics: Diagnostics) -> SceneDescription:
    """Add a grey square below the scene; a ground that only shows its shadow is hidden from the camera."""
    up = _up(description)
    low, high = framed_bounds(description, up)
    radius = float(np.linalg.norm(high - low)) / 2
    right, forward = [axis for axis in range(3) if axis != up]
    middle = (low + high) / 2
    points = np.zeros((4, 3))
    points[:, up] = low[up] - GROUND_GAP * radius
    for k, (a, b) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        points[k, right] = middle[right] + a * GROUND_SIZE * radius
        points[k, forward] = middle[forward] + b * GROUND_SIZE * radius
    # The normal is along the up axis: z cross x is y, and x cross y is z.
    triangles = np.array([[0, 2, 1], [0, 3, 2]] if up == 1 else [[0, 1, 2], [0, 2, 3]], np.int32)
    sight = CameraSight.HIDDEN if ground is Ground.SHADOW else CameraSight.SEEN
    surface = Surface(GROUND, lambert=True, diffuse_color=(GROUND_ALBEDO,) * 3, camera=sight)
    center = points.mean(axis=0)
    mesh = Mesh(
        GROUND, np.asarray(points - center, np.float32), triangles, normals=None, colors=None, surface=len(description.surfaces)
    )
    matrix = np.eye(4)
    matrix[:3, 3] = center
    shown = "The shadow on a ground" if ground is Ground.SHADOW else "A grey ground"
    diagnostics.add("staging", "", f"{shown} is added below the scene, at {low[up] + 0.0:.6g}, as requested.")
    return replace(
        description,
        shapes=(*description.shapes, mesh),
        surfaces=(*description.surfaces, surface),
        static=(*description.static, Placed(len(description.shapes), matrix)),
    )


def _without_visible_domes(description: SceneDescription, diagnostics: Diagnostics) -> SceneDescription:
    """Hide domes and distant lights from the camera, as another background is requested."""
    far = (LightType.DOME, LightType.DISTANT)
    hidden = [light.path for light in description.lights if light.type in far and light.visible_to_camera]
    if not hidden:
        return description
    diagnostics.add("staging", "", f"Hidden from the camera, as another background is requested: {', '.join(hidden)}.")
    lights = tuple(
        replace(light, visible_to_camera=light.visible_to_camera and light.type not in far) for light in description.lights
    )
    return replace(description, lights=lights)


TEST_WIDTH = 96  # pixels of the test render's longer side
BLOCK = 4  # pixels per side of a block, whose mean is tested
SAMPLES = 3  # per pixel, without any pilot pass
# Radiance, after exposure, below which a block is dark: the default view shows it as 2 of 255.
DARK_RADIANCE = 0.01
LEAST_LIT = 0.35  # share of the coverage: with less, most of the image would be black


def with_studio_where_dark(
    description: SceneDescription,
    settings: RenderSettings,
    diagnostics: Diagnostics,
    build: Callable[[SceneDescription, RenderSettings], CoreScene],
) -> SceneDescription:
    """Return the description, with a studio light if its emissive surfaces light too little of the image."""
    if not _needs_test_render(description, settings):
        return description
    share = _lit_share(description, settings, build)
    if share is None or share >= LEAST_LIT:
        return description
    diagnostics.add(
        "default-light",
        "",
        f"The stage has no light, and its emissive surfaces light {share:.0%} of what is visible: a studio light is added, "
        "which the camera does not see.",
    )
    return replace(description, lights=default_lights(description.camera, description.up_axis == "Z"))


def _needs_test_render(description: SceneDescription, settings: RenderSettings) -> bool:
    """Return whether a test render has to decide; translation already adds the studio light to stages without emission."""
    if settings.studio is not StudioLight.AUTO or description.lights or not description.may_need_light:
        return False
    return any(map(_is_emissive, description.surfaces))


def _is_emissive(surface: Surface) -> bool:
    return any(value > 0 for value in surface.emissive_color) or "emissive_color" in surface.varying


def _lit_share(
    description: SceneDescription, settings: RenderSettings, build: Callable[[SceneDescription, RenderSettings], CoreScene]
) -> float | None:
    """Return the share of the visible scene that is not dark in a test render; None if nothing is visible."""
    from .. import core

    width, height = description.resolution
    scale = min(1.0, TEST_WIDTH / max(width, height))
    small = (max(1, round(width * scale)), max(1, round(height * scale)))
    quick = RenderSettings(
        spp=SAMPLES, max_depth=settings.max_depth, threads=settings.threads, dicing_rate=settings.dicing_rate
    )
    scene = build(replace(description, resolution=small, pixels=None, aovs=()), quick)
    pixels, _ = core.render(scene, quick).image()
    return lit_share(pixels)


def lit_share(pixels: Floats) -> float | None:
    """Return the share of coverage in blocks whose mean colour is not dark, of premultiplied pixels (H, W, 4)."""
    height, width = pixels.shape[:2]
    padded = np.zeros((-(-height // BLOCK) * BLOCK, -(-width // BLOCK) * BLOCK, 4))
    padded[:height, :width] = np.where(np.isfinite(pixels), pixels, 0)
    blocks = padded.reshape(padded.shape[0] // BLOCK, BLOCK, padded.shape[1] // BLOCK, BLOCK, 4).sum(axis=(1, 3))
    covered = blocks[..., 3]
    if not covered.any():
        return None
    is_lit = blocks[..., :3].max(axis=-1) >= DARK_RADIANCE * covered
    return float(covered[is_lit & (covered > 0)].sum() / covered.sum())
