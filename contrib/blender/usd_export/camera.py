# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's camera: perspective and orthographic with shift, panoramic by a table of directions; and the render settings."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender

from .lights import placed

Note = Callable[[str, str, str], None]
TENTHS = 10.0  # lengths of a UsdGeomCamera's film are in tenths of the scene's unit
MM = 0.001
TABLE = 2048  # least length of a table of directions


def write_camera(stage: Usd.Stage, path: str, scene: Any, obj: Any, matrix: Any, folder: Path, note: Note) -> None:
    """Write an evaluated camera object."""
    data = obj.data
    camera = UsdGeom.Camera.Define(stage, path)
    UsdGeom.Xformable(camera).AddTransformOp().Set(placed(matrix, False))
    camera.CreateClippingRangeAttr(Gf.Vec2f(data.clip_start, data.clip_end))
    if data.type == "PANO":
        _write_directions(camera, data, scene, folder, obj.name, note)
        return
    corners = data.view_frame(scene=scene)
    x, y = [c.x for c in corners], [c.y for c in corners]
    # The frame is at some depth: film of the same angle lies at the focal length.
    focal = data.lens * MM
    scale = TENTHS * (1.0 if data.type == "ORTHO" else focal / -corners[0].z)
    camera.CreateHorizontalApertureAttr((max(x) - min(x)) * scale)
    camera.CreateVerticalApertureAttr((max(y) - min(y)) * scale)
    camera.CreateHorizontalApertureOffsetAttr((max(x) + min(x)) / 2 * scale)
    camera.CreateVerticalApertureOffsetAttr((max(y) + min(y)) / 2 * scale)
    camera.CreateFocalLengthAttr(focal * TENTHS)
    if data.type == "ORTHO":
        camera.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
        if data.dof.use_dof:
            note("camera-lens", obj.name, "an orthographic camera has no depth of field")
    elif data.dof.use_dof:
        _write_lens(camera, data, matrix, obj.name, note)


def _write_lens(camera: UsdGeom.Camera, data: Any, matrix: Any, name: str, note: Note) -> None:
    dof = data.dof
    distance = dof.focus_distance
    if dof.focus_object is not None:
        ahead = matrix.to_3x3().normalized() @ __import__("mathutils").Vector((0, 0, -1))
        distance = abs((dof.focus_object.matrix_world.translation - matrix.translation).dot(ahead))
    camera.CreateFStopAttr(dof.aperture_fstop)
    camera.CreateFocusDistanceAttr(distance)
    if dof.aperture_blades > 2:
        prim = camera.GetPrim()
        prim.CreateAttribute("arnold:aperture_blades", Sdf.ValueTypeNames.Int).Set(dof.aperture_blades)
        prim.CreateAttribute("arnold:aperture_rotation", Sdf.ValueTypeNames.Float).Set(math.degrees(dof.aperture_rotation))
    if dof.aperture_ratio != 1:
        note("camera-lens", name, "the lens's ratio (anamorphic bokeh) is not rendered: it is 1")


def _write_directions(camera: UsdGeom.Camera, data: Any, scene: Any, folder: Path, name: str, note: Note) -> None:
    """Write a table of directions, one a pixel, which primray takes for a lens."""
    at = data if hasattr(data, "panorama_type") else data.cycles
    width = max(scene.render.resolution_x * scene.render.resolution_percentage // 100, 1)
    height = max(scene.render.resolution_y * scene.render.resolution_percentage // 100, 1)
    # Finer than pixels, as a table is interpolated: at the edge of a fisheye's circle with what sees nothing.
    finer = max(1, -(-TABLE // max(width, height)))
    width, height = width * finer, height * finer
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)  # v upwards, as Blender's images
    directions = _directions(at, u, v, data, width, height)
    if directions is None:
        kind = at.panorama_type.lower().replace("_", " ")
        note("camera-projection", name, f"a panoramic camera of type {kind} is rendered as equirectangular")
        directions = _equirectangular(u, v, (-math.pi, math.pi), (-math.pi / 2, math.pi / 2))
    image = bpy.data.images.new("primray directions", width, height, alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.concatenate([directions, np.ones_like(u)[..., None]], axis=2).astype(np.float32).ravel())
    image.file_format = "OPEN_EXR"
    file = folder / "directions.exr"
    image.filepath_raw = str(file)
    image.save()
    bpy.data.images.remove(image)
    prim, prefix = camera.GetPrim(), "omni:lensdistortion:lut:"
    prim.CreateAttribute("omni:lensdistortion:model", Sdf.ValueTypeNames.Token).Set("lut")
    prim.CreateAttribute(f"{prefix}nominalWidth", Sdf.ValueTypeNames.Float).Set(float(width))
    prim.CreateAttribute(f"{prefix}nominalHeight", Sdf.ValueTypeNames.Float).Set(float(height))
    prim.CreateAttribute(f"{prefix}rayEnterDirectionTexture", Sdf.ValueTypeNames.Asset).Set(f"./{file.name}")
    camera.CreateHorizontalApertureAttr(float(width))
    camera.CreateVerticalApertureAttr(float(height))


def _directions(at: Any, u: Any, v: Any, data: Any, width: int, height: int) -> Any:
    """Return directions in the camera's axes for points of the picture (0 to 1, upwards); None for other projections."""
    if at.panorama_type == "EQUIRECTANGULAR":
        return _equirectangular(u, v, (at.longitude_min, at.longitude_max), (at.latitude_min, at.latitude_max))
    if at.panorama_type == "FISHEYE_EQUIDISTANT":
        x, y = 2 * u - 1, 2 * v - 1
        radius = np.hypot(x, y)
        angle = radius * at.fisheye_fov / 2
        return _around_axis(x, y, radius, angle, radius <= 1)
    if at.panorama_type == "FISHEYE_EQUISOLID":
        # The film is as large as a perspective camera's; focal length and film in millimetres.
        wide = width >= height if data.sensor_fit == "AUTO" else data.sensor_fit == "HORIZONTAL"
        size = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
        x = (u - 0.5) * (size if wide else size * width / height)
        y = (v - 0.5) * (size * height / width if wide else size)
        radius = np.hypot(x, y)
        reach = 2 * at.fisheye_lens * math.sin(at.fisheye_fov / 4)
        angle = 2 * np.arcsin(np.minimum(radius / (2 * at.fisheye_lens), 1))
        return _around_axis(x, y, radius, angle, radius <= reach)
    return None


def _equirectangular(u: Any, v: Any, longitudes: tuple[float, float], latitudes: tuple[float, float]) -> Any:
    longitude = longitudes[0] + u * (longitudes[1] - longitudes[0])
    latitude = latitudes[0] + v * (latitudes[1] - latitudes[0])
    return np.stack([np.sin(longitude) * np.cos(latitude), np.sin(latitude), -np.cos(longitude) * np.cos(latitude)], axis=2)


def _around_axis(x: Any, y: Any, radius: Any, angle: Any, seen: Any) -> Any:
    around = np.sin(angle) / np.maximum(radius, 1e-12)
    directions = np.stack([x * around, y * around, -np.cos(angle)], axis=2)
    directions[~seen] = 0
    return directions


def write_settings(stage: Usd.Stage, scene: Any, camera: str, asked: dict[str, Any]) -> None:
    """Write the stage's RenderSettings: camera, resolution, filter and when to stop."""
    render = scene.render
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    settings.CreateCameraRel().SetTargets([Sdf.Path(camera)])
    size = (
        render.resolution_x * render.resolution_percentage // 100,
        render.resolution_y * render.resolution_percentage // 100,
    )
    settings.CreateResolutionAttr(Gf.Vec2i(max(size[0], 1), max(size[1], 1)))
    settings.CreatePixelAspectRatioAttr(render.pixel_aspect_y / render.pixel_aspect_x)
    settings.CreateAspectRatioConformPolicyAttr(
        "adjustPixelAspectRatio" if render.pixel_aspect_x != render.pixel_aspect_y else "expandAperture"
    )
    prim, types = settings.GetPrim(), Sdf.ValueTypeNames
    prim.CreateAttribute("primray:filter", types.Token).Set("blackman-harris")
    # Blender's width is half of the filter's support.
    prim.CreateAttribute("primray:filterWidth", types.Float).Set(2 * render.filter_size)
    for name, kind in (
        ("samples", types.Int),
        ("targetError", types.Float),
        ("timeLimit", types.Float),
        ("maxDepth", types.Int),
    ):
        if asked.get(name):
            prim.CreateAttribute(f"primray:{name}", kind).Set(asked[name])
    if asked.get("denoise"):
        prim.CreateAttribute("primray:denoise", types.Bool).Set(True)
    stage.SetMetadata("renderSettingsPrimPath", "/Render/settings")
