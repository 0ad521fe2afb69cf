# SPDX-License-Identifier: GPL-3.0-or-later
"""The world as a dome light: a colour, an environment texture with its rotation, or a picture of anything else.

Worlds of other nodes are rendered by Cycles' panoramic camera into a lat-long image.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
from mathutils import Euler, Matrix
from pxr import Gf, Usd, UsdGeom, UsdLux

from .lights import light_group
from .volumes import fog_of, medium_of, write_fog

Note = Callable[[str, str, str], None]
BAKED_WIDTH, BAKED_SAMPLES = 1024, 16
# A lat-long image's middle is -Y in Blender, which looks up along Z.
BLENDER_FROM_DOME = Euler((math.radians(90), 0, math.radians(90)), "XYZ").to_matrix().to_4x4()


def write_world(stage: Usd.Stage, path: str, scene: Any, folder: Path, note: Note) -> None:
    """Write the scene's world; a dark dome where it has none, as stages without any light get a studio light."""
    dome = UsdLux.DomeLight.Define(stage, path)
    matrix = BLENDER_FROM_DOME
    color, intensity = (0.0, 0.0, 0.0), 0.0
    world = scene.world
    background = _background(world) if world else None
    if world is None or (background is None and _surface(world) is None):
        color = tuple(world.color) if world and world.node_tree is None else color
        intensity = 1.0 if any(color) else 0.0
    elif background is not None and _is_plain(background):
        color, intensity = tuple(background.inputs["Color"].default_value[:3]), background.inputs["Strength"].default_value
    else:
        environment = _environment(background) if background is not None else None
        file = image_file(environment[0].image, folder) if environment else None
        if environment and file:
            color, intensity = (1.0, 1.0, 1.0), background.inputs["Strength"].default_value
            matrix = environment[1].inverted() @ BLENDER_FROM_DOME
        else:
            file = _baked(scene, folder)
            color, intensity = (1.0, 1.0, 1.0), 1.0
            note("world-baked", world.name, f"the world's nodes are rendered into an image {BAKED_WIDTH} pixels wide")
        dome.CreateTextureFileAttr(f"./{Path(file).name}" if Path(file).parent == folder else file)
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    medium = medium_of(world.node_tree, "OUTPUT_WORLD", world.name, note) if world is not None else None
    fog = fog_of(medium, world.name, note) if medium is not None else None
    if fog is not None:
        write_fog(stage, fog)
    dome.CreateColorAttr(Gf.Vec3f(*color))
    dome.CreateIntensityAttr(intensity)
    UsdGeom.Xformable(dome).AddTransformOp().Set(Gf.Matrix4d([list(row) for row in matrix.transposed()]))
    if world is not None and world.lightgroup:
        light_group(dome.GetPrim(), world.lightgroup)


def _surface(world: Any, socket: str = "Surface") -> Any:
    """Return the node that is linked to the world's output, or None."""
    if world.node_tree is None:
        return None
    for node in world.node_tree.nodes:
        if node.type == "OUTPUT_WORLD" and node.is_active_output:
            return node.inputs[socket].links[0].from_node if node.inputs[socket].is_linked else None
    return None


def _background(world: Any) -> Any:
    node = _surface(world)
    return node if node is not None and node.type == "BACKGROUND" else None


def _is_plain(background: Any) -> bool:
    return not background.inputs["Color"].is_linked and not background.inputs["Strength"].is_linked


def _environment(background: Any) -> tuple[Any, Matrix] | None:
    """Return the environment texture and the rotation of its lookups; None if anything else is in its way."""
    if background.inputs["Strength"].is_linked:
        return None
    texture = background.inputs["Color"].links[0].from_node
    if texture.type != "TEX_ENVIRONMENT" or texture.projection != "EQUIRECTANGULAR" or texture.image is None:
        return None
    if not texture.inputs["Vector"].is_linked:
        return texture, Matrix.Identity(4)
    mapping = texture.inputs["Vector"].links[0].from_node
    if mapping.type == "TEX_COORD" and texture.inputs["Vector"].links[0].from_socket.name == "Generated":
        return texture, Matrix.Identity(4)
    if mapping.type != "MAPPING" or any(socket.is_linked for socket in mapping.inputs if socket.name != "Vector"):
        return None
    source = mapping.inputs["Vector"].links[0].from_socket if mapping.inputs["Vector"].is_linked else None
    if source is None or source.node.type != "TEX_COORD" or source.name != "Generated" or mapping.vector_type == "NORMAL":
        return None
    scale = tuple(mapping.inputs["Scale"].default_value)
    if max(scale) - min(scale) > 1e-6 or min(scale) <= 0:
        return None
    if mapping.vector_type == "POINT" and any(mapping.inputs["Location"].default_value):
        return None
    if mapping.vector_type == "TEXTURE" and any(mapping.inputs["Location"].default_value):
        return None
    rotation = Euler(mapping.inputs["Rotation"].default_value, "XYZ").to_matrix().to_4x4()
    return texture, rotation.inverted() if mapping.vector_type == "TEXTURE" else rotation


def image_file(image: Any, folder: Path) -> str | None:
    """Return the path of an image's file; of one that has none (packed, generated) that of a copy in `folder`."""
    path = Path(bpy.path.abspath(image.filepath_raw, library=image.library)) if image.filepath_raw else None
    if image.packed_file is None and path is not None and path.is_file():
        return str(path)
    if image.packed_file is None and image.source != "GENERATED":
        return None
    suffix = Path(image.filepath_raw).suffix or (".exr" if image.is_float else ".png")
    file = folder / f"image-{bpy.path.clean_name(image.name)}{suffix}"
    if not file.exists():
        if image.packed_file is not None:
            file.write_bytes(image.packed_file.data)
        else:
            image.file_format = "OPEN_EXR" if image.is_float else "PNG"
            image.save(filepath=str(file))
    return str(file)


def _baked(scene: Any, folder: Path) -> str:
    """Render the world alone into a lat-long image."""
    file = folder / "world.exr"
    view = bpy.data.scenes.new("primray world")
    try:
        camera = bpy.data.objects.new("primray world", bpy.data.cameras.new("primray world"))
        camera.data.type = "PANO"
        at = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
        at.panorama_type = "EQUIRECTANGULAR"
        camera.rotation_euler = (math.radians(90), 0, math.radians(-90))
        view.collection.objects.link(camera)
        view.camera, view.world = camera, scene.world
        view.render.engine = "CYCLES"
        view.cycles.samples, view.cycles.use_denoising, view.cycles.use_adaptive_sampling = BAKED_SAMPLES, False, False
        view.render.resolution_x, view.render.resolution_y, view.render.resolution_percentage = (
            BAKED_WIDTH,
            BAKED_WIDTH // 2,
            100,
        )
        view.render.image_settings.file_format = "OPEN_EXR"
        view.render.image_settings.color_depth = "32"
        view.render.filepath = str(file)
        bpy.ops.render.render(write_still=True, scene=view.name)
    finally:
        bpy.data.scenes.remove(view)
    return str(file)
