"""What moves in a compared scene, as Blender's keyframes: from half a frame before frame 1 to half a frame after."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .plain import PlainScene

FRAME = 1
KEYS = ((0.5, -0.5), (1.5, 0.5))  # frames, and times about the frame
STEPS = 3  # 9 times, between which Cycles turns at a constant rate


def animate(bpy: Any, scene: PlainScene, world: Any, z_up: Any) -> None:
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "LINEAR"
    motion = scene["motion"]
    for mesh, glide in motion["glides"].items():
        thing = bpy.data.objects[mesh]
        thing.parent = None
        _travel(thing, z_up, glide["center"], glide["shift"])
        _turn(thing, glide["turn_deg"])
    for mesh in motion["ends"]:
        _bend(bpy.data.objects[mesh], scene.ends(mesh))
    if motion["swarms"]:
        _swarm(bpy, scene, world, z_up)
    if motion["pan"]:
        _pan(bpy, motion["pan"], world, z_up)
    world.render.use_motion_blur = True
    world.render.motion_blur_shutter, world.render.motion_blur_position = 1.0, "CENTER"
    world.frame_set(FRAME)


def _travel(thing: Any, z_up: Any, middle: Any, shift: Any) -> None:
    thing.cycles.motion_steps = STEPS
    for frame, time in KEYS:
        thing.location = z_up.to_3x3() @ type(thing.location)(np.asarray(middle) + np.asarray(shift) * time)
        thing.keyframe_insert("location", frame=frame)


def _turn(thing: Any, turn_deg: float) -> None:
    """About y, then from y up to z up: in this order of angles what comes last is applied first."""
    thing.rotation_mode = "ZYX"
    for frame, time in KEYS:
        thing.rotation_euler = (math.pi / 2, math.radians(turn_deg * time), 0.0)
        thing.keyframe_insert("rotation_euler", frame=frame)


def _bend(thing: Any, ends: Any) -> None:
    thing.shape_key_add(name="opening")
    key = thing.shape_key_add(name="closing", from_mix=False)
    key.data.foreach_set("co", np.ascontiguousarray(ends, np.float32).ravel())
    for frame, time in KEYS:
        key.value = time + 0.5
        key.keyframe_insert("value", frame=frame)


def _swarm(bpy: Any, scene: PlainScene, world: Any, z_up: Any) -> None:
    """An object each, that a parent takes along."""
    prototype = bpy.data.objects[scene["placed"]["mesh"]]
    number, shifts = scene.swarms()
    leaders = []
    for shift in shifts:
        leader = bpy.data.objects.new("swarm", None)
        world.collection.objects.link(leader)
        _travel(leader, z_up, (0.0, 0.0, 0.0), shift)
        leaders.append(leader)
    for matrix, k in zip(scene.matrices(), number, strict=True):
        one = prototype.copy()
        one.parent, one.matrix_parent_inverse = leaders[k], z_up.Identity(4)
        one.matrix_basis = z_up @ type(z_up)(matrix.tolist())
        world.collection.objects.link(one)
    bpy.data.objects.remove(prototype)


def _pan(bpy: Any, pan: dict[str, Any], world: Any, z_up: Any) -> None:
    head = bpy.data.objects.new("head", None)
    world.collection.objects.link(head)
    _travel(head, z_up, pan["eye"], pan["shift"])
    _turn(head, pan["turn_deg"])
    camera = world.camera
    camera.cycles.motion_steps = STEPS
    camera.parent, camera.matrix_parent_inverse = head, z_up.Identity(4)
    camera.matrix_basis = type(z_up).Rotation(math.radians(-pan["down_deg"]), 4, "X")
