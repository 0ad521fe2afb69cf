"""A compared scene as a JSON file, PLY meshes, a NumPy array of matrices and EXR skies: for renderers that read no USD."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from .scene import Lamp, Scene
from .scenes import SCENES
from .shapes import Triangles, ball, cylinder, disc, rectangle
from .write_usd import write_usd

LAMP_SHAPES: dict[str, Callable[[Lamp], Triangles]] = {
    "rect": lambda lamp: rectangle(lamp.center, lamp.half_u, lamp.half_v),
    "disc": lambda lamp: disc(lamp.center, lamp.half_u, lamp.half_v),
    "tube": lambda lamp: cylinder(lamp.center, lamp.half_u, lamp.radius),
    "ball": lambda lamp: ball_of_area(lamp.center, lamp.radius),
}


def ball_of_area(center: tuple[float, ...], radius: float) -> Triangles:
    """A ball of triangles that has the area of a sphere, and so its light, for those without spheres of light."""
    made = ball(3, 1.0)
    a, b, c = (made.points[made.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return replace(made, points=made.points * radius * np.sqrt(4 * np.pi / area) + np.asarray(center))


def write_scene(name: str, folder: Path) -> None:
    """All of a scene's files, the JSON last: where that is, the others are."""
    scene = SCENES[name]()
    folder.mkdir(parents=True, exist_ok=True)
    for file, pixels in scene.images.items():
        height, width, channels = pixels.shape
        image = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, "float"))
        image.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, channels), np.ascontiguousarray(pixels))
        if not image.write(str(folder / file)):
            raise SystemExit(image.geterror())
    for mesh, shape in scene.meshes.items():
        _write_ply(folder / f"{name}_{mesh}.ply", shape)
    for k, lamp in enumerate(scene.lamps):
        if lamp.kind in LAMP_SHAPES:
            _write_ply(folder / f"{name}_light_{k}.ply", LAMP_SHAPES[lamp.kind](lamp))
    if scene.placed is not None:
        np.save(folder / f"{name}_placed.npy", scene.placed.matrices().astype(np.float32))
    if scene.strands is not None:
        np.save(folder / f"{name}_strands.npy", scene.strands.points.astype(np.float32))
    if scene.moves:
        _write_motion(scene, folder)
    write_usd(scene, folder / f"{name}.usdc")
    (folder / f"{name}.json").write_text(json.dumps(_plain(scene)))


def _write_motion(scene: Scene, folder: Path) -> None:
    """And the scene as USD without motion, all meshes once where they are described, for those that move them themselves."""
    for mesh, points in scene.ends.items():
        np.save(folder / f"{scene.name}_{mesh}_ends.npy", points.astype(np.float32))
    objects, placed = list(scene.objects), scene.placed
    if placed is not None and placed.swarm is not None and placed.shifts is not None:
        np.savez(folder / f"{scene.name}_swarms.npz", swarm=placed.swarm, shifts=placed.shifts)
        objects.append((placed.mesh, placed.look))
    still = replace(scene, glides={}, ends={}, pan=None, placed=None, objects=objects)
    write_usd(still, folder / f"{scene.name}_still.usdc")


def _motion(scene: Scene) -> dict[str, object] | None:
    if not scene.moves:
        return None
    return {
        "glides": {mesh: asdict(glide) for mesh, glide in scene.glides.items()},
        "ends": list(scene.ends),
        "pan": None if scene.pan is None else asdict(scene.pan),
        "swarms": scene.placed is not None and scene.placed.swarm is not None,
    }


def _plain(scene: Scene) -> dict[str, object]:
    return {
        "name": scene.name,
        "resolution": scene.resolution,
        "depth": scene.depth,
        "camera": asdict(scene.camera),
        "looks": {name: asdict(look) for name, look in scene.looks.items()},
        "objects": scene.objects,
        "smooth": [name for name, mesh in scene.meshes.items() if mesh.normals is not None],
        "placed": None if scene.placed is None else {"mesh": scene.placed.mesh, "look": scene.placed.look},
        "strands": None if scene.strands is None else {"radius": scene.strands.radius, "look": scene.strands.look},
        "lamps": [asdict(lamp) for lamp in scene.lamps],
        "motion": _motion(scene),
    }


def _write_ply(path: Path, shape: Triangles) -> None:
    names = ["x", "y", "z"] if shape.normals is None else ["x", "y", "z", "nx", "ny", "nz"]
    vertices = shape.points if shape.normals is None else np.concatenate([shape.points, shape.normals], axis=1)
    faces = np.empty(len(shape.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, shape.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    path.write_bytes("\n".join(header).encode() + b"\n" + vertices.astype("<f4").tobytes() + faces.tobytes())
