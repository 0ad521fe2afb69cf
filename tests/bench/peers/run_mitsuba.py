"""Mitsuba 3 on a compared scene (loop.py has the job). Variants: llvm and scalar, with the independent or the multijitter
sampler: `llvm-multijitter`. The LLVM variants need DRJIT_LIBLLVM_PATH where the library is not found by its usual name."""

from __future__ import annotations

import time
from typing import Any

from .loop import Render, Save, Stages, run
from .plain import EMITTING, PlainScene


def setup(scene: PlainScene, job: dict[str, Any]) -> tuple[Render, Save, Stages]:
    engine, _, sampler = job["variant"].partition("-")
    began = time.perf_counter()
    import drjit
    import mitsuba as mi
    import numpy as np

    mi.set_variant({"llvm": "llvm_ad_rgb", "scalar": "scalar_rgb"}[engine])
    mi.set_log_level(mi.LogLevel.Error)
    drjit.set_thread_count(job["threads"])
    imported = time.perf_counter()
    width, height = scene["resolution"]
    camera = scene["camera"]
    place = mi.ScalarTransform4f
    up = [0, 1, 0]
    film = {
        "type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "component_format": "float32",
        "rfilter": {"type": "box"},
    }  # fmt: skip
    world: dict[str, Any] = {
        "type": "scene",
        # Its depth counts the segments of a path: one more than its scatterings.
        "integrator": {"type": "path", "max_depth": scene["depth"] + 1},
        "sensor": {
            "type": "perspective", "fov": camera["fov_deg"], "fov_axis": "x", "near_clip": 0.01, "far_clip": 1e5,
            "to_world": place().look_at(camera["eye"], camera["target"], up), "film": film,
            "sampler": {"type": sampler or "independent"},
        },
    }  # fmt: skip
    for name, look in scene["looks"].items():
        world[f"look_{name}"] = _bsdf(look)
    glows = {name: _area(look["color"]) for name, look in scene["looks"].items() if look["kind"] in EMITTING}
    for mesh, look in scene["objects"]:
        world[f"mesh_{mesh}"] = _ply(scene, mesh, look)
        if look in glows:
            world[f"mesh_{mesh}"]["emitter"] = glows[look]
    if scene["placed"]:
        world["group"] = {"type": "shapegroup", "shape": _ply(scene, **scene["placed"])}
        reference = {"type": "ref", "id": "group"}
        for k, matrix in enumerate(scene.matrices()):
            world[f"instance_{k}"] = {"type": "instance", "to_world": place(matrix), "group": reference}
    if scene.facts.get("strands"):
        world["strands"] = _strands(scene)
    for k, lamp in enumerate(scene["lamps"]):
        world[f"light_{k}"] = _emitter(scene, lamp, place, np)
    described = time.perf_counter()
    loaded = mi.load_dict(world)
    if engine == "llvm":
        drjit.sync_thread()
    stages = {
        "import": imported - began, "describe": described - imported, "load": time.perf_counter() - described,
    }  # fmt: skip
    last: dict[str, Any] = {}

    def render(samples: int, seed: int) -> None:
        last["pixels"] = np.array(mi.render(loaded, spp=samples, seed=seed))  # waits for the kernel

    return render, lambda path: mi.Bitmap(last["pixels"]).write(path), stages


def _rgb(value: list[float]) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}


def _area(radiance: list[float]) -> dict[str, Any]:
    return {"type": "area", "radiance": _rgb(radiance)}


def _bsdf(look: dict[str, Any]) -> dict[str, Any]:
    if look["kind"] == "glass":
        return {"type": "dielectric", "int_ior": look["ior"], "ext_ior": 1.0}
    if look["kind"] in ("metal", "plastic"):
        base = {"type": "principled", "base_color": _rgb(look["color"]), "roughness": look["roughness"]}
        kind = {"metallic": 1.0} if look["kind"] == "metal" else {"metallic": 0.0, "eta": look["ior"]}
        return {"type": "twosided", "one": base | kind}
    if look["kind"] == "hair":
        return {
            "type": "hair", "sigma_a": _rgb(look["color"]), "longitudinal_roughness": look["roughness"],
            "azimuthal_roughness": look["roughness"], "scale_tilt": 0.0, "int_ior": look["ior"],
        }  # fmt: skip
    if look["kind"] == "layered":
        base = {
            "type": "principled", "base_color": _rgb(look["color"]), "roughness": look["roughness"], "eta": look["ior"],
            "metallic": look["metalness"], "clearcoat": look["coat"], "clearcoat_gloss": 0.9, "sheen": look["fuzz"],
        }  # fmt: skip
        through = {"spec_trans": look["transmission"]}
        return base | through if look["transmission"] else {"type": "twosided", "one": base}
    color = [0.0, 0.0, 0.0] if look["kind"] in EMITTING else look["color"]
    return {"type": "twosided", "one": {"type": "diffuse", "reflectance": _rgb(color)}}


def _ply(scene: PlainScene, mesh: str, look: str) -> dict[str, Any]:
    faceted = mesh not in scene["smooth"]
    return {"type": "ply", "filename": scene.ply(mesh), "face_normals": faceted, "bsdf": {"type": "ref", "id": f"look_{look}"}}


def _strands(scene: PlainScene) -> dict[str, Any]:
    """Lines of control points with their radius, strands apart by empty ones."""
    path, radius = scene.file(f"{scene.name}_strands.txt"), scene["strands"]["radius"]
    with open(path, "w") as out:
        for strand in scene.strands():
            out.writelines(f"{x:.8g} {y:.8g} {z:.8g} {radius}\n" for x, y, z in strand)
            out.write("\n")
    return {"type": "bsplinecurve", "filename": path, "bsdf": {"type": "ref", "id": f"look_{scene['strands']['look']}"}}


def _emitter(scene: PlainScene, lamp: dict[str, Any], place: Any, np: Any) -> dict[str, Any]:
    kind = lamp["kind"]
    if kind == "sky":
        return {"type": "envmap", "filename": scene.file(lamp["image"])}
    if kind == "sun":
        return {"type": "directional", "direction": lamp["direction"], "irradiance": _rgb(lamp["radiance"])}
    area = _area(lamp["radiance"])
    if kind == "ball":
        return {"type": "sphere", "center": lamp["center"], "radius": lamp["radius"], "emitter": area}
    if kind == "tube":
        center, half = np.array(lamp["center"], float), np.array(lamp["half_u"], float)
        ends = {"p0": (center - half).tolist(), "p1": (center + half).tolist()}
        return {"type": "cylinder", "radius": lamp["radius"], "emitter": area} | ends
    u, v = np.array(lamp["half_u"], float), np.array(lamp["half_v"], float)
    normal = np.cross(u, v)
    matrix = np.eye(4)
    matrix[:3] = np.stack([u, v, normal / np.linalg.norm(normal), lamp["center"]], axis=1)
    return {"type": "disk" if kind == "disc" else "rectangle", "to_world": place(matrix), "emitter": area}


if __name__ == "__main__":
    run(setup)
