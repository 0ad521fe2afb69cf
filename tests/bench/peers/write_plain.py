"""A compared scene as a JSON file, PLY meshes, a NumPy array of matrices and EXR skies: for renderers that read no USD."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from .scenes import SCENES, Lamp, Scene
from .shapes import Triangles, cylinder, disc, rectangle
from .write_usd import write_usd

LAMP_SHAPES: dict[str, Callable[[Lamp], Triangles]] = {
    "rect": lambda lamp: rectangle(lamp.center, lamp.half_u, lamp.half_v),
    "disc": lambda lamp: disc(lamp.center, lamp.half_u, lamp.half_v),
    "tube": lambda lamp: cylinder(lamp.center, lamp.half_u, lamp.radius),
}


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
    write_usd(scene, folder / f"{name}.usdc")
    (folder / f"{name}.json").write_text(json.dumps(_plain(scene)))


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
        "lamps": [asdict(lamp) for lamp in scene.lamps],
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
