"""Additions to a stage that the user's settings ask for: studio light, dome, ground, camera orbit.

They change the translated description, before textures are loaded and shapes are diced. The stage is not edited, so that
nothing that refers to its prims (light links, collections, instances) can change. Each addition is reported as `staging`, the
studio light as `default-light`.

A small test render decides whether a stage with emissive surfaces but no lights needs the studio light. An estimate from powers
and areas would miss occlusion and textures of the emission. The test render takes a few thousand samples of a scene built at
its size; only stages with emission and without lights pay for it. Its seed, size and samples are fixed, so that all processes
and machines decide alike.

The shadow on an invisible ground (a shadow catcher) is an opacity: 1 - direct light with the scene / direct light without. The
image itself hides the ground from the camera, so that its colours, coverage and errors are those of the scene. The ground is
visible in two small renders of direct light with the same samples: where nothing blocks the light their ratio is exactly 1, and
the ground has no visible edge. Tiles without a shadow, and those that the image covers, are dropped early; the others are
sampled until the shadow has the samples of the image or has cost as much. The cost is measured in rays, so that the same
render has the same shadow; only a time limit depends on the clock.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from . import core
from .arrays import Doubles, Floats
from .color.color_space import LUMINANCE_WEIGHTS
from .description import Camera, CameraMotion, Light, LightType, Mesh, Placed, SceneDescription, Surface, TextureFile
from .description.shading import CameraVisibility
from .diagnostics import Diagnostics
from .errors import SettingsError
from .settings import SAMPLE_BLOCK, Ground, RenderSettings, StudioLight
from .textures.texture import Texture
from .textures.texture_set import LIGHT_LEFT_OUT
from .usd import framed_bounds
from .usd.lights.default_light import KEY, STUDIO, default_lights

if TYPE_CHECKING:
    from .core import CoreScene


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


def turn_about_up(degrees: float, description: SceneDescription) -> Doubles:
    """Return the rotation (4, 4) about a scene's up axis, counterclockwise as seen from above."""
    return _turned(degrees, _up(description))


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
    visibility = CameraVisibility.HIDDEN if ground is Ground.SHADOW else CameraVisibility.SEEN
    surface = Surface(GROUND, lambert=True, diffuse_color=(GROUND_ALBEDO,) * 3, camera=visibility)
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
    from . import core

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


LEAST = 0.002  # smaller opacities (half a step of 8 bits) are rounding errors of positions on a large ground
LEAST_SAMPLES, MOST_SAMPLES = 16, 256  # per pixel
JUDGED_AT = 8  # samples per pixel after which tiles without a shadow, in them or a neighbour, are dropped


@dataclass(frozen=True)
class Spent:
    """Cost of an image: average samples per pixel, and rays."""

    samples: float
    rays: int


@dataclass(frozen=True, eq=False)
class GroundShadow:
    """Inputs to compute the shadow of a diced scene after its image is rendered."""

    description: SceneDescription
    textures: dict[TextureFile, list[tuple[int, Texture]]]
    settings: RenderSettings

    def opacity(self, coverage: Floats, spent: Spent) -> Floats:
        """Return the shadow's opacity (H, W), 0 to 1; `coverage` (H, W) and `spent` are the image's."""
        start = time.perf_counter()
        views = _Views(self._shadowed(), self._bare(), self.textures, self._settings(spent))
        is_open = _tiles(coverage < 1, views.tiles)
        limit_s = self.settings.shadow_time_s
        samples = SAMPLE_BLOCK
        while True:
            views.take(samples, is_open)
            if samples >= JUDGED_AT:
                is_open &= _with_neighbours(_tiles(views.opacity() > 0, views.tiles), views.tiles)
            if samples >= views.settings.most_samples or not is_open.any():
                break
            if limit_s is None:
                if samples >= LEAST_SAMPLES and spent.rays < 2 * views.rays:
                    break
            elif 2 * (time.perf_counter() - start) > limit_s:
                break
            samples = min(2 * samples, views.settings.most_samples)
        return views.opacity()

    def _settings(self, spent: Spent) -> RenderSettings:
        given = self.settings
        samples = int(min(max(spent.samples, LEAST_SAMPLES), MOST_SAMPLES))
        return RenderSettings(
            spp=-(-samples // SAMPLE_BLOCK) * SAMPLE_BLOCK,
            max_depth=1,
            filter=given.filter,
            filter_width=given.filter_width,
            seed=given.seed,
            threads=given.threads,
        )

    def _shadowed(self) -> SceneDescription:
        """Return the scene with only the ground visible to the camera; the rest casts its shadow.

        Fog is hidden as well: it takes light from the ground, but the image has what is between the camera and the ground.
        """
        hidden = CameraVisibility.HIDDEN
        surfaces = tuple(
            replace(surface, camera=CameraVisibility.SEEN if surface.path == GROUND else hidden)
            for surface in self.description.surfaces
        )
        fog = self.description.fog
        return replace(
            self.description,
            surfaces=surfaces,
            media=tuple(replace(medium, camera=hidden) for medium in self.description.media),
            volume_emissions=tuple(replace(glow, camera=hidden) for glow in self.description.volume_emissions),
            fog=None if fog is None else replace(fog, hidden=True),
        )

    def _bare(self) -> SceneDescription:
        """Return the scene with the ground alone, and the fog."""
        shown = self._shadowed()
        (placed,) = (p for p in shown.static if shown.shapes[p.shape].path == GROUND)
        alone = (Placed(0, placed.matrix),)
        return replace(
            shown,
            shapes=(shown.shapes[placed.shape],),
            static=alone,
            prototypes=(),
            placements=(),
            media=(),
            volume_emissions=(),
        )


class _Views:
    """The two renders of the ground, with the same samples."""

    def __init__(
        self,
        shadowed: SceneDescription,
        bare: SceneDescription,
        textures: dict[TextureFile, list[tuple[int, Texture]]],
        settings: RenderSettings,
    ) -> None:
        self.settings = settings
        self._scenes = [core.build(replace(view, aovs=()), dict(textures), settings) for view in (shadowed, bare)]
        self._films = [core.Film(scene, settings=settings) for scene in self._scenes]
        self._splits = core.choose_splits(self._scenes[0], settings)

    @property
    def tiles(self) -> tuple[int, int]:
        return self._films[0].tiles

    @property
    def rays(self) -> int:
        return sum(int(film.rays) for film in self._films)

    def take(self, samples: int, is_open: npt.NDArray[np.bool_]) -> None:
        """Render the open tiles up to `samples` samples per pixel."""
        for scene, film in zip(self._scenes, self._films, strict=True):
            ends = np.where(is_open[None], core.uniform_ends(film, samples), film.next)
            core.render_pass(scene, film, ends, self._splits, self.settings)

    def opacity(self) -> Floats:
        shadowed, bare = (film.image()[0] for film in self._films)
        weights = np.array(LUMINANCE_WEIGHTS, np.float64)
        light, most = shadowed[..., :3] @ weights, bare[..., :3] @ weights
        ratio = np.divide(light, most, out=np.ones_like(most), where=most > 0)
        opacity = np.clip(1 - ratio, 0, 1) * np.clip(bare[..., 3], 0, 1)
        return np.where(opacity < LEAST, 0, opacity).astype(np.float32)


def _tiles(pixels: npt.NDArray[np.bool_], tiles: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return whether any pixel of each tile is set, (tiles,), rows of tiles from the top."""
    columns, rows = tiles
    whole = np.zeros((rows * core.TILE, columns * core.TILE), bool)
    whole[: pixels.shape[0], : pixels.shape[1]] = pixels
    found: npt.NDArray[np.bool_] = whole.reshape(rows, core.TILE, columns, core.TILE).any(axis=(1, 3)).ravel()
    return found


def _with_neighbours(chosen: npt.NDArray[np.bool_], tiles: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return the chosen tiles and the eight around each, (tiles,)."""
    columns, rows = tiles
    grid = np.pad(chosen.reshape(rows, columns), 1)
    found = np.zeros((rows, columns), bool)
    for y in range(3):
        for x in range(3):
            found |= grid[y : y + rows, x : x + columns]
    return found.ravel()
