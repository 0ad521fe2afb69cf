"""LuxCore on a compared scene (loop.py has the job), with the Sobol sampler, adaptive sampling off.

Variants: its CPU path tracer; "bidirectional", its bidirectional one; "photons", the path tracer with its cache of caustics,
which is biased: photons are gathered within PHOTON_RADIUS, which shrinks as it renders.
"""

from __future__ import annotations

import time
from typing import Any

from .loop import Render, Save, Stages, run
from .plain import EMITTING, PlainScene

NEVER = 10**9
PHOTON_RADIUS = 0.05  # in a scene's metres


def setup(scene: PlainScene, job: dict[str, Any]) -> tuple[Render, Save, Stages]:
    began = time.perf_counter()
    import pyluxcore

    pyluxcore.Init()
    imported = time.perf_counter()
    world = pyluxcore.Scene()
    world.Parse(_properties(pyluxcore, dict(_description(scene))))
    if scene["placed"]:
        for k, matrix in enumerate(scene.matrices()):
            world.DuplicateObject("prototype", f"instance_{k}", matrix.T.ravel().tolist(), k)
        world.DeleteObject("prototype")
    stages = {"import": imported - began, "load": time.perf_counter() - imported}
    last: dict[str, Any] = {}

    def render(samples: int, seed: int) -> None:
        config = _properties(pyluxcore, _settings(scene, job, samples, seed))
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config, world))
        session.Start()
        while not session.HasDone():
            session.UpdateStats()
            time.sleep(0.01)
        session.Stop()
        last["film"] = session.GetFilm()
        last["session"] = session  # the film lives in it

    def save(path: str) -> None:
        last["film"].SaveOutput(path, pyluxcore.FilmOutputType.RGB, pyluxcore.Properties())

    return render, save, stages


def _properties(pyluxcore: Any, values: dict[str, Any]) -> Any:
    found = pyluxcore.Properties()
    for key, value in values.items():
        found.Set(pyluxcore.Property(key, list(value) if isinstance(value, (list, tuple)) else [value]))
    return found


def _settings(scene: PlainScene, job: dict[str, Any], samples: int, seed: int) -> dict[str, Any]:
    width, height = scene["resolution"]
    depth = scene["depth"] + 1  # it counts segments
    return _of_variant(job["variant"], depth) | {
        "renderengine.seed": seed,
        "sampler.type": "SOBOL",
        "sampler.sobol.adaptive.strength": 0.0,
        "film.width": width,
        "film.height": height,
        "film.filter.type": "BOX",
        "film.filter.width": 0.5,  # a radius
        "film.imagepipelines.0.0.type": "NOP",
        "film.noiseestimation.warmup": NEVER,
        **{f"path.pathdepth.{kind}": depth for kind in ("total", "diffuse", "glossy", "specular")},
        "path.clamping.variance.maxvalue": 0.0,
        "native.threads.count": job["threads"],
        "batch.haltspp": samples,
        "lightstrategy.type": "LOG_POWER",
    }


def _of_variant(variant: str, depth: int) -> dict[str, Any]:
    if variant == "bidirectional":
        return {"renderengine.type": "BIDIRCPU", "path.maxdepth": depth, "light.maxdepth": depth}
    path = {"renderengine.type": "PATHCPU"}
    if variant != "photons":
        return path
    return path | {
        "path.photongi.caustic.enabled": 1,
        "path.photongi.caustic.lookup.radius": PHOTON_RADIUS,
        "path.photongi.photon.maxdepth": depth,
    }


def _description(scene: PlainScene) -> Any:
    camera = scene["camera"]
    yield "scene.camera.type", "perspective"
    yield "scene.camera.lookat.orig", [float(x) for x in camera["eye"]]
    yield "scene.camera.lookat.target", [float(x) for x in camera["target"]]
    yield "scene.camera.up", [0.0, 1.0, 0.0]
    yield "scene.camera.fieldofview", float(camera["fov_deg"])  # of the longer side
    yield "scene.camera.cliphither", 0.01
    yield "scene.camera.clipyon", 1e5
    for name, look in scene["looks"].items():
        for key, value in _look(look):
            yield f"scene.materials.{name}.{key}", value
    objects = [(mesh, mesh, look) for mesh, look in scene["objects"]]
    if scene["placed"]:
        objects.append(("prototype", scene["placed"]["mesh"], scene["placed"]["look"]))
    for name, mesh, look in objects:
        yield f"scene.objects.{name}.ply", scene.ply(mesh)
        yield f"scene.objects.{name}.material", look
    for k, lamp in enumerate(scene["lamps"]):
        yield from _lamp(scene, lamp, f"light_{k}")


def _look(look: dict[str, Any]) -> Any:
    color = [float(c) for c in look["color"]]
    if look["kind"] == "glass":
        yield from (("type", "glass"), ("kr", [1.0] * 3), ("kt", [1.0] * 3), ("interiorior", look["ior"]), ("exteriorior", 1.0))
    elif look["kind"] == "metal":
        yield from (("type", "disney"), ("basecolor", color), ("metallic", 1.0), ("roughness", look["roughness"]))
    elif look["kind"] == "plastic":
        yield from (("type", "disney"), ("basecolor", color), ("specular", 0.5), ("roughness", look["roughness"]))
    elif look["kind"] in EMITTING:
        yield from _glow(color)
    else:
        yield from (("type", "matte"), ("kd", color))


def _glow(radiance: list[float]) -> Any:
    return ("type", "matte"), ("kd", [0.0] * 3), ("emission", radiance)


def _lamp(scene: PlainScene, lamp: dict[str, Any], name: str) -> Any:
    at = f"scene.lights.{name}."
    color = [float(c) for c in lamp["radiance"]]
    if lamp["kind"] == "sky":
        yield at + "type", "infinite"
        yield at + "file", scene.file(lamp["image"])
        yield at + "gamma", 1.0
        # Its sky looks along its own axes, z up: columns, world from sky.
        yield at + "transformation", [0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    elif lamp["kind"] == "sun":
        yield from ((at + "type", "sharpdistant"), (at + "direction", lamp["direction"]), (at + "color", color))
    elif lamp["kind"] in ("rect", "disc", "tube", "ball"):
        for key, value in _glow(color):
            yield f"scene.materials.{name}.{key}", value
        yield f"scene.objects.{name}.ply", scene.ply(name)
        yield f"scene.objects.{name}.material", name
    else:
        raise SystemExit(f"no {lamp['kind']} for LuxCore")


if __name__ == "__main__":
    run(setup)
