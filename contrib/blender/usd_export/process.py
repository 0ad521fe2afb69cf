# SPDX-License-Identifier: GPL-3.0-or-later
"""A background Blender that exports scenes: reads requests, lines of JSON, and answers each by a line with MARK before it.

What ends this process (Blender's exporter can) leaves the user's Blender as it is. A request names a .blend file with one
scene, its view layer, frame and the folder to write into; the answer has the stage and notes on what differs from Blender.
"""

from __future__ import annotations

import json
import math
import sys
import traceback
from pathlib import Path
from typing import Any

import bpy

bpy.utils.expose_bundled_modules()

from pxr import Usd, UsdGeom  # noqa: E402 - Blender's own USD, which has to be exposed first

from . import camera, geometry, lights, materials, motion, reuse, volumes, world  # noqa: E402

MARK = "primray: "
WANTED = {
    "selected_objects_only": False,
    "export_animation": False,
    "export_hair": True,
    "export_uvmaps": True,
    "export_normals": True,
    "export_mesh_colors": True,
    "export_materials": True,
    "generate_preview_surface": True,
    "generate_materialx_network": True,
    "export_subdivision": "BEST_MATCH",
    "export_armatures": False,
    "export_shapekeys": False,
    "use_instancing": False,
    "evaluation_mode": "RENDER",
    "export_textures_mode": "KEEP",
    "export_textures": False,
    "relative_paths": False,
    "xform_op_mode": "MAT",
    "export_custom_properties": True,
    "author_blender_name": True,
    "export_lights": False,
    "export_cameras": False,
    "convert_world_material": False,
    "convert_scene_units": "METERS",
    "root_prim_path": "/root",
}


class Export(bpy.types.RenderEngine):  # type: ignore[misc]
    """An engine that renders nothing: it is handed the scene as it is evaluated for renders."""

    bl_idname = "PRIMRAY_EXPORT"
    bl_label = "primray's export"
    found: Any = None

    def __init__(self, *arguments: Any, **values: Any) -> None:
        super().__init__(*arguments, **values)

    def render(self, depsgraph: Any) -> None:
        Export.found(depsgraph)


def main() -> None:
    bpy.utils.register_class(Export)
    for line in sys.stdin:
        try:
            answer = _export(json.loads(line))
        except Exception as error:
            traceback.print_exc()
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(f"\n{MARK}{json.dumps(answer)}", flush=True)


def _export(request: dict[str, Any]) -> dict[str, Any]:
    folder = Path(request["folder"])
    folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.open_mainfile(filepath=request["blend"], load_ui=False)
    scene = bpy.data.scenes[request["scene"]]
    if bpy.context.window is not None:
        bpy.context.window.scene = scene
    shutter = motion.shutter_of(scene) if request.get("needs_camera", True) and not request.get("instant") else None
    frame = request["frame"] + request.get("subframe", 0.0)
    others = _instants(request, frame, shutter) if shutter else []
    if others:
        bpy.ops.wm.open_mainfile(filepath=request["blend"], load_ui=False)
        scene = bpy.data.scenes[request["scene"]]
        if bpy.context.window is not None:
            bpy.context.window.scene = scene
    still = {obj.name for obj in scene.objects if not getattr(getattr(obj, "cycles", None), "use_motion_blur", True)}
    scene.frame_set(math.floor(frame), subframe=frame - math.floor(frame))
    notes: list[dict[str, str]] = []

    def note(code: str, name: str, message: str) -> None:
        row = {"code": code, "object": name, "message": message}
        if row not in notes:
            notes.append(row)

    file = folder / "stage.usda"
    layer = Usd.Stage.CreateNew(str(file)) if not file.exists() else Usd.Stage.Open(str(file))
    layer.GetRootLayer().Clear()
    UsdGeom.SetStageUpAxis(layer, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(layer, 1.0)
    root = UsdGeom.Xform.Define(layer, "/root")
    layer.SetDefaultPrim(root.GetPrim())
    scope = "/root/_primray"
    UsdGeom.Scope.Define(layer, scope)
    found = geometry.Found()

    shapes = reuse.Shapes()
    places: dict[str, dict[str, Any]] = {}

    def collect(depsgraph: Any) -> None:
        nonlocal shapes
        shapes = reuse.look_at(depsgraph)
        places.update(_write_lights_and_camera(layer, scope, depsgraph, folder, note))
        geometry.find_instances(depsgraph, found, note)

    Export.found = staticmethod(collect)
    scene.render.engine = Export.bl_idname
    scene.render.use_motion_blur = False
    if scene.camera is None:
        if request.get("needs_camera", True):
            raise ValueError("the scene has no camera")
        # A viewport needs none, but Blender's render does.
        scene.camera = bpy.data.objects.new("primray camera", bpy.data.cameras.new("primray camera"))
        scene.collection.objects.link(scene.camera)
    bpy.ops.render.render(scene=scene.name, layer=request["layer"])
    systems = _hair(scene)
    if not request.get("instant"):
        world.write_world(layer, f"{scope}/world", scene, folder, note)
    names = geometry.prepare_scene(scene, found)
    geometry.repair_slots()
    materials.rewrite_materials(note)
    for image in bpy.data.images:
        if image.packed_file is not None or (image.source == "GENERATED" and image.users):
            path = world.image_file(image, folder)
            if path:
                image.filepath = path
                if image.packed_file is not None:
                    image.unpack(method="REMOVE")
    exported = folder / "blender.usdc"
    _use_layer(scene, request["layer"])
    counts = reuse.export(scene, request["layer"], exported, shapes, found, names, _write_shapes)
    layer.GetRootLayer().subLayerPaths.append(f"./{exported.name}")
    geometry.write_instances(layer, scope, geometry.prims_by_object(layer), names)
    volumes.write_volumes(layer, scope, scene, geometry.prims_by_object(layer), note)
    geometry.group_glowing_meshes(layer, geometry.prims_by_object(layer))
    geometry.repair_hair(layer, layer, systems, note)
    materials.repair_networks(layer)
    camera.write_settings(layer, scene, f"{scope}/camera", request.get("settings", {}))
    if shutter:
        motion.merge(layer, frame, others, still, note)
        lens = UsdGeom.Camera(layer.GetPrimAtPath(f"{scope}/camera"))
        lens.CreateShutterOpenAttr(shutter[0])
        lens.CreateShutterCloseAttr(shutter[1])
        layer.SetStartTimeCode(frame)
        layer.SetEndTimeCode(frame)
        layer.SetTimeCodesPerSecond(scene.render.fps / scene.render.fps_base)
    layer.GetRootLayer().Save()
    known = geometry.blender_names(layer, names)
    places = reuse.places(scene, geometry.prims_by_object(layer), shapes, found) | places
    return {"stage": str(file), "notes": notes, "names": known, "transparent": scene.render.film_transparent,
            "exported": counts, "places": places, "time_code": frame if shutter else None}  # fmt: skip


def _instants(request: dict[str, Any], frame: float, shutter: tuple[float, float]) -> list[tuple[float, Usd.Stage]]:
    """Export the scene at other instants of the shutter. Returns their frames and stages."""
    found = []
    for at in motion.instants(shutter):
        begin = math.floor(frame + at)
        folder = f"{request['folder']}/at{at:+g}"
        asked = {"frame": begin, "subframe": frame + at - begin, "folder": folder, "instant": True}
        found.append((frame + at, Usd.Stage.Open(_export({**request, **asked})["stage"])))
    return found


def _write_shapes(**values: Any) -> None:
    known = bpy.ops.wm.usd_export.get_rna_type().properties.keys()
    bpy.ops.wm.usd_export(
        **{name: value for name, value in {**WANTED, **values}.items() if name in known or name == "filepath"}
    )


def _use_layer(scene: Any, name: str) -> None:
    if bpy.context.window is not None:
        bpy.context.window.scene = scene
        bpy.context.window.view_layer = scene.view_layers[name]


def _write_lights_and_camera(layer: Usd.Stage, scope: str, depsgraph: Any, folder: Path, note: Any) -> dict[str, Any]:
    """Write lamps and the camera. Returns where the transforms of lamps are that are no instances."""
    number = 0
    places: dict[str, Any] = {}
    instanced: set[str] = set()
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type == "LIGHT" and instance.show_self:
            path = f"{scope}/light_{number}"
            keeps_scale, extra = lights.write_light(layer, path, obj, instance.matrix_world.copy(), folder, note)
            places[obj.original.name] = {"kind": "light", "path": path, "keeps_scale": keeps_scale, "extra": extra}
            if instance.is_instance:
                instanced.add(obj.original.name)
            layer.GetPrimAtPath(path).SetMetadata("displayName", obj.name)
            number += 1
        elif obj.type == "LIGHT_PROBE":
            continue
    scene = depsgraph.scene_eval
    obj = scene.camera.evaluated_get(depsgraph)
    camera.write_camera(layer, f"{scope}/camera", scene, obj, obj.matrix_world.copy(), folder, note)
    return {name: place for name, place in places.items() if name not in instanced}


def _hair(scene: Any) -> dict[str, geometry.Hair]:
    """Return what hair of particle systems is like, by their names. Blender's Root and Tip are diameters (Cycles,
    ObtainCacheParticleData)."""
    found = {}
    for obj in scene.objects:
        for system in obj.particle_systems:
            settings = system.settings
            scale = settings.radius_scale / 2
            slots = obj.material_slots
            slot = slots[min(settings.material, len(slots)) - 1] if slots else None
            look = slot.material.name if slot is not None and slot.material is not None else ""
            radii = settings.root_radius * scale, settings.tip_radius * scale
            found[system.name] = geometry.Hair(*radii, settings.shape, settings.use_close_tip, look)
    return found


if __name__ == "__main__":
    main()
