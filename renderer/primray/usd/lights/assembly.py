"""Lights of the scene, one for each placement, and the studio light of a stage without lights."""

from __future__ import annotations

from itertools import islice

from ...arrays import Doubles
from ...description import Camera, Surface
from ...description.placement import chunks
from ...settings import StudioLight
from ..instancing.instances import Chain
from ..motion.levels import any_moves
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..scene.translated_scene import TranslatedScene
from ..stage.metadata import up_axis
from ..stage.values import square
from .authored import AuthoredLight
from .default_light import default_lights
from .light_settings import read_light_settings
from .motion import LightPath, report_changing_size

# Each costs 55 microseconds and 1 kB here; the core samples among this many lights as fast as among 20.
MAX_LIGHT_INSTANCES = 1 << 18


def add_lights(
    scene: TranslatedScene,
    leaf: ResolvedPrim,
    group_from_prim: Doubles,
    chains: list[Chain],
    count: int,
    blur_scale: float,
    ctx: Context,
) -> None:
    """Add one light for each placement, as a light's emission depends on its size in the world."""
    if count > MAX_LIGHT_INSTANCES:
        ctx.warn(
            "instanced-lights",
            leaf.path,
            f"Only the first {MAX_LIGHT_INSTANCES} of the light's {count} instances are rendered.",
        )
    report_changing_size(leaf, ctx)
    rules = read_light_settings(leaf, ctx, scene.links)
    authored = AuthoredLight(leaf, ctx)
    matrices = ((chain, k, row) for chain in chains for k, row in enumerate(row for rows in chunks(chain) for row in rows))
    for chain, k, row in islice(matrices, MAX_LIGHT_INSTANCES):
        made = scene.adapters.lights[leaf.type_name](authored, square(row) @ group_from_prim)
        if made is None:
            continue
        if any_moves(chain):
            scene.moving_lights.append((len(scene.lights), LightPath(chain, k, group_from_prim, blur_scale)))
        scene.lights.append(rules.applied(made))


def add_default_light(scene: TranslatedScene, camera: Camera, ctx: Context) -> bool:
    """Add the studio light if it is asked for or the stage has no light (one that emits nothing is a light).

    Return whether the choice is left open: a surface emits, and how much of the picture it lights is not known yet.
    """
    asked = ctx.settings.studio
    if asked is StudioLight.OFF:
        return False
    if asked is StudioLight.AUTO:
        if scene.has_lights or ctx.settings.dome is not None:
            return False
        if scene.volume_emissions or any(_is_emissive(s) for s in ctx.surfaces):
            return True
    scene.lights += default_lights(camera, up_axis(ctx.stage) == "Z")
    if asked is StudioLight.ON:
        ctx.warn("default-light", "", "A studio light is added, as requested; the camera does not see it.")
    else:
        what = "The stage has no light and nothing emissive: a studio light is added, which the camera does not see."
        ctx.warn("default-light", "", what)
    return False


def _is_emissive(surface: Surface) -> bool:
    if surface.volume is not None and any(surface.volume.emission):
        return True
    return any(surface.emissive_color) or any(name == "emissive_color" for name, _ in surface.inputs)
