"""Fog that slats shade from a sun, beside Mitsuba and Cycles: CPU seconds and errors at equal light.

python -m tests.bench.shafts            all that PRIMRAY_PEERS has, to tests/bench/results
python shafts.py RENDERER SAMPLES FILE  one picture, by the Python of that renderer

A cube of 4 units of fog (extinction 0.15, albedo 0.9, isotropic), seven black slats below its top, a floor of albedo 0.5, and a
sun without extent. CPU seconds are of all threads and of the picture alone, without set-up.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
EXTINCTION, ALBEDO, IRRADIANCE, MOST_SCATTERINGS = 0.15, 0.9, 5.0, 32
SUN = np.array([0.5, -0.8, -0.25]) / np.linalg.norm([0.5, -0.8, -0.25])
EYE, TARGET, LENS_MM, APERTURE_MM, SIZE, THREADS = (2.5, 0.8, 9.0), (0.0, -0.1, 0.0), 32.0, 24.0, 96, 2
REFERENCE, SAMPLES = 8192, (64, 256, 1024)


def quads() -> list[tuple[Floats, float]]:
    """Return corners (4, 3) and albedos."""
    found = [(-1.9, 1.9, -1.9, 0.5)] + [(-1.9 + 0.57 * k, -1.54 + 0.57 * k, 1.5, 0.0) for k in range(7)]
    return [(np.array([(a, y, 1.9), (b, y, 1.9), (b, y, -1.9), (a, y, -1.9)]), albedo) for a, b, y, albedo in found]


def facing(z: npt.ArrayLike, origin: npt.ArrayLike = (0, 0, 0)) -> Floats:
    """Return the pose whose z axis is `z`."""
    pose = np.eye(4)
    pose[:3, 2] = np.asarray(z) / np.linalg.norm(z)
    side = np.cross([0, 1, 0], pose[:3, 2])
    pose[:3, 0] = side / np.linalg.norm(side)
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = origin
    return pose


CAMERA = facing(np.array(EYE) - TARGET, EYE)


def stage_text() -> str:
    def matrix(pose: Floats) -> str:
        rows = ", ".join("(" + ", ".join(map(repr, row)) + ")" for row in pose.T.tolist())
        return f'matrix4d xformOp:transform = ({rows})\nuniform token[] xformOpOrder = ["xformOp:transform"]'

    scattering, absorption = EXTINCTION * ALBEDO, EXTINCTION * (1 - ALBEDO)
    text = f"""#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Material "fog" {{
    token outputs:mtlx:volume.connect = </fog/volume.outputs:out>
    def Shader "volume" {{
        uniform token info:id = "ND_volume"
        token inputs:vdf.connect = </fog/particles.outputs:out>
        token outputs:out
    }}
    def Shader "particles" {{
        uniform token info:id = "ND_anisotropic_vdf"
        float3 inputs:absorption = ({absorption}, {absorption}, {absorption})
        float3 inputs:scattering = ({scattering}, {scattering}, {scattering})
        token outputs:out
    }}
}}
def Cube "box" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    double size = 4
    rel material:binding = </fog>
}}
def DistantLight "sun" {{
    float inputs:angle = 0
    float inputs:intensity = {IRRADIANCE}
    {matrix(facing(-SUN))}
}}
def Camera "camera" {{
    float focalLength = {LENS_MM}
    float horizontalAperture = {APERTURE_MM}
    float verticalAperture = {APERTURE_MM}
    float2 clippingRange = (0.01, 1000)
    {matrix(CAMERA)}
}}
"""
    for k, (corners, albedo) in enumerate(quads()):
        points = ", ".join(map(str, map(tuple, corners.tolist())))
        text += f"""def Mesh "quad{k}" {{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    uniform bool doubleSided = true
    color3f[] primvars:displayColor = [({albedo}, {albedo}, {albedo})]
    point3f[] points = [{points}]
}}
"""
    return text


def by_primray(samples: int) -> tuple[Any, float]:
    import primray

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shafts.usda"
        path.write_text(stage_text(), encoding="utf-8")
        image = primray.render(path, resolution=(SIZE, SIZE), spp=samples, max_depth=MOST_SCATTERINGS, threads=THREADS,
                               filter="box", seed=samples)  # fmt: skip
    return image.pixels[..., :3], image.report["cpu_s"]


def by_mitsuba(samples: int) -> tuple[Any, float]:
    import drjit
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(THREADS)
    place, gray = mi.ScalarTransform4f, lambda value: {"type": "rgb", "value": float(value)}
    fog = {"type": "homogeneous", "sigma_t": gray(EXTINCTION), "albedo": gray(ALBEDO), "phase": {"type": "isotropic"}}
    scene = {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": MOST_SCATTERINGS + 1, "rr_depth": 5},
        "sensor": {
            "type": "perspective", "fov": float(np.degrees(2 * np.arctan(APERTURE_MM / 2 / LENS_MM))),
            "to_world": place((CAMERA @ np.diag([-1, 1, -1, 1])).tolist()),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        },
        "box": {"type": "cube", "to_world": place().scale([2, 2, 2]), "bsdf": {"type": "null"}, "interior": fog},
        "sun": {"type": "directional", "direction": SUN.tolist(), "irradiance": gray(IRRADIANCE)},
    }  # fmt: skip
    for k, (corners, albedo) in enumerate(quads()):
        pose = facing((0, 1, 0.0001), corners.mean(axis=0))
        u, v = (corners[1] - corners[0]) / 2, (corners[3] - corners[0]) / 2
        pose[:3, 0], pose[:3, 1], pose[:3, 2] = u, v, np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        diffuse = {"type": "twosided", "inside": {"type": "diffuse", "reflectance": gray(albedo)}}
        scene[f"quad{k}"] = {"type": "rectangle", "to_world": place(pose.tolist()), "bsdf": diffuse}
    made = mi.load_dict(scene)
    part = min(samples, 64)
    np.array(mi.render(made, spp=part, seed=1 << 20))  # compiles the kernel
    began = time.process_time()
    total = sum(np.array(mi.render(made, spp=part, seed=k)) for k in range(samples // part))
    return total / (samples // part), time.process_time() - began


def by_cycles(samples: int) -> tuple[Any, float]:
    import bpy
    import mathutils

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", samples, False, False
    cycles.max_bounces = cycles.volume_bounces = cycles.diffuse_bounces = MOST_SCATTERINGS
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = 0
    cycles.pixel_filter_type, cycles.volume_biased = "BOX", False
    cycles.filter_width = 1.0
    scene.render.threads_mode, scene.render.threads = "FIXED", THREADS
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"

    def material(name: str, socket: str, *shaders: tuple[str, float, float]) -> Any:
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        tree = made.node_tree
        tree.nodes.clear()
        outputs = []
        for kind, color, density in shaders:
            node = tree.nodes.new(kind)
            node.inputs["Color"].default_value = (color, color, color, 1)
            if "Density" in node.inputs:
                node.inputs["Density"].default_value = density
            outputs.append(node.outputs[0])
        if len(outputs) == 2:
            add = tree.nodes.new("ShaderNodeAddShader")
            for one, to in zip(outputs, add.inputs, strict=True):
                tree.links.new(one, to)
            outputs = [add.outputs[0]]
        tree.links.new(outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[socket])
        return made

    def mesh(name: str, points: list[Any], faces: list[Any], of: Any) -> None:
        made = bpy.data.meshes.new(name)
        made.from_pydata(points, [], faces)
        made.materials.append(of)
        scene.collection.objects.link(bpy.data.objects.new(name, made))

    fog = material("fog", "Volume", ("ShaderNodeVolumeScatter", 1.0, EXTINCTION * ALBEDO),
                   ("ShaderNodeVolumeAbsorption", 0.0, EXTINCTION * (1 - ALBEDO)))  # fmt: skip
    corners = [(x, y, z) for x in (-2, 2) for y in (-2, 2) for z in (-2, 2)]
    mesh("box", corners, [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)], fog)
    for k, (points, albedo) in enumerate(quads()):
        mesh(f"quad{k}", points.tolist(), [(0, 1, 2, 3)], material(f"m{k}", "Surface", ("ShaderNodeBsdfDiffuse", albedo, 0.0)))
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle = IRRADIANCE, 0.0
    eye = bpy.data.cameras.new("eye")
    eye.sensor_width, eye.lens, eye.clip_end = APERTURE_MM, LENS_MM, 1e4
    for name, data, pose in (("sun", sun, facing(-SUN)), ("eye", eye, CAMERA)):
        placed = bpy.data.objects.new(name, data)
        scene.collection.objects.link(placed)
        placed.matrix_world = mathutils.Matrix(pose.tolist())
        scene.camera = placed
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/picture.exr"
        began = time.process_time()
        bpy.ops.render.render(write_still=True)
        seconds = time.process_time() - began
        shown = bpy.data.images.load(scene.render.filepath)
        pixels = np.array(shown.pixels[:]).reshape(SIZE, SIZE, 4)[::-1, :, :3]
    return pixels, seconds


BY = {"primray": by_primray, "mitsuba": by_mitsuba, "cycles": by_cycles}
PEERS = {"mitsuba": "mi", "cycles": "bpy"}


def picture(renderer: str, samples: int) -> tuple[Floats, float]:
    """Return what the renderer makes in a process of its own, and its CPU seconds."""
    folder = os.environ.get("PRIMRAY_PEERS", "")
    python = sys.executable if renderer == "primray" else f"{folder}/{PEERS[renderer]}/bin/python"
    with tempfile.TemporaryDirectory() as made:
        file = Path(made) / "picture.npz"
        subprocess.run([python, __file__, renderer, str(samples), str(file)], check=True, stdout=subprocess.DEVNULL)
        kept = np.load(file)
        return kept["pixels"].astype(np.float64), float(kept["seconds"])


def main() -> None:
    from .results import write_results

    folder = Path(os.environ.get("PRIMRAY_PEERS", "/nowhere"))
    renderers = [name for name in BY if name == "primray" or (folder / PEERS[name]).exists()]
    references = {name: picture(name, REFERENCE)[0] for name in renderers}
    truth = references["primray"]
    rows: list[dict[str, Any]] = []
    for name in renderers:
        for samples in SAMPLES:
            found, seconds = picture(name, samples)
            error = float((((found - truth) ** 2) / (truth**2 + 0.01)).mean())
            rows.append({"scene": "shafts", "renderer": name, "samples": samples, "relmse": error, "cpu_s": seconds,
                         "mean_off": float(references[name].mean() / truth.mean() - 1)})  # fmt: skip
            print(json.dumps(rows[-1]), flush=True)
    write_results("volumes", rows)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        pixels, seconds = BY[sys.argv[1]](int(sys.argv[2]))
        np.savez(sys.argv[3], pixels=pixels, seconds=seconds)
    else:
        main()
