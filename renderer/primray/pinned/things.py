"""Digests of what reaches the core, by prim: where they are equal, pixels are equal, whatever the files look like."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable

from ..checkpoints.fingerprint import Digests, TextureSet
from ..description import SceneDescription

MOST = 4096  # above this, prims are digested by their parents
LETTERS = 16  # of a digest: it finds a difference, and proves nothing


def things_of(description: SceneDescription, textures: TextureSet, most: int = MOST) -> dict[str, str]:
    """Return a digest of each shape, material and light ("shape /World/table"), of the camera and of instances.

    Parents stand for their prims where there are more than `most`.
    """
    digests = Digests(textures)
    found: dict[tuple[str, str], list[str]] = defaultdict(list)

    def add(kind: str, path: str, value: object) -> None:
        found[kind, path].append(digests.of(value))

    for shape in description.shapes:
        add("shape", shape.path, shape)
    for placed in description.static:
        add("shape", description.shapes[placed.shape].path, placed.matrix)
    for surface in description.surfaces:
        add("material", surface.path, surface)
    for light in description.lights:
        add("light", light.path, light)
    for volume in description.volumes:
        add("volume", volume.path, volume)
    for prototype in description.prototypes:
        add("prototype", prototype.path, prototype)
    if description.placements:
        add("instances", "", description.placements)
    add("camera", description.camera.path, (description.camera, description.exposure, description.camera_motion))
    if description.linked.members.size:
        add("light linking", "", description.linked)
    return {f"{kind} {path}".rstrip(): _joined(values) for (kind, path), values in sorted(_grouped(found, most).items())}


def _joined(digests: Iterable[str]) -> str:
    return hashlib.sha256("".join(digests).encode()).hexdigest()[:LETTERS]


def _grouped(found: dict[tuple[str, str], list[str]], most: int) -> dict[tuple[str, str], list[str]]:
    depth = max(path.count("/") for _, path in found)
    while len(found) > most and depth > 1:
        depth -= 1
        fewer: dict[tuple[str, str], list[str]] = defaultdict(list)
        for (kind, path), values in sorted(found.items()):
            fewer[kind, "/".join(path.split("/")[: depth + 1])] += values
        found = fewer
    return found
