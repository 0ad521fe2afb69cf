"""Fingerprint of a scene: digests of its contents, independent of where its files are and what its prims are called.

Computed from the translated description, before dicing, with the textures' contents in place of their paths.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from ..description import SceneDescription, TextureFile
from ..textures.texture import Texture

# Fields that say where something comes from, or what was noticed in translation, but not what it looks like.
IGNORED_FIELDS = {"path", "collections", "bad_texels", "turned", "names", "instance", "diffusion", "content", "loader"}

TextureSet = Mapping[TextureFile, Sequence[tuple[int, Texture]]]


# The description's fields in each part, by names that errors can show.
PARTS = {
    "geometry": ("shapes", "static", "prototypes", "placements"),
    "materials": ("surfaces",),
    "lights": ("lights", "linked"),
    "camera": ("camera", "exposure", "camera_motion"),
    "frame": ("pixels", "pixel_aspect_ratio"),
}

# Fields that belong to the geometry where they are not empty: scenes without volumes have the digests that they had before
# descriptions had any.
VOLUMES = ("media", "volume_emissions")


def fields_of(part: str) -> tuple[str, ...]:
    """Return the description's fields that the digest of a part depends on."""
    return PARTS[part] + (VOLUMES if part == "geometry" else ())


def fingerprint(description: SceneDescription, textures: TextureSet) -> dict[str, str]:
    """Return the digests of geometry, materials, lights, camera and the rendered frame."""
    return fingerprint_of(description, textures, PARTS)


def fingerprint_of(description: SceneDescription, textures: TextureSet, parts: Collection[str]) -> dict[str, str]:
    """Return the digests of some parts."""
    digests = Digests(textures)
    return {name: digests.of(_part(description, name)) for name in PARTS if name in parts}


def _part(description: SceneDescription, name: str) -> Any:
    values = tuple(getattr(description, field) for field in PARTS[name])
    if name == "geometry" and description.volumes:
        values += tuple(getattr(description, field) for field in VOLUMES)
    return values[0] if len(values) == 1 else values


class Digests:
    """Digests of parts of a description. Each image is hashed once."""

    def __init__(self, textures: TextureSet) -> None:
        self._textures = textures
        self._images: dict[int, str] = {}

    def of(self, value: Any) -> str:
        h = hashlib.sha256()
        self._add(h, value)
        return h.hexdigest()

    def _add(self, h: Any, value: Any) -> None:
        """Hash a value preceded by its type and size, so that different values never give the same bytes."""
        if value is None or isinstance(value, bool | int | np.integer):
            h.update(f"{value};".encode())
        elif isinstance(value, float | np.floating):
            h.update(b"f" + struct.pack("<d", float(value)))
        elif isinstance(value, str):
            h.update(f"s{len(value)}:{value}".encode("utf-8", "surrogatepass"))
        elif isinstance(value, np.ndarray):
            h.update(f"a{value.dtype.str}{value.shape}".encode())
            h.update(np.ascontiguousarray(value).data)
        elif isinstance(value, tuple | list):
            h.update(f"t{len(value)}:".encode())
            for item in value:
                self._add(h, item)
        elif isinstance(value, Enum):
            self._add(h, value.value)
        elif isinstance(value, TextureFile):
            self._add_texture(h, value)
        elif is_dataclass(value):
            h.update(f"d{type(value).__name__}:".encode())
            for item in fields(value):
                if item.name not in IGNORED_FIELDS:
                    self._add(h, getattr(value, item.name))
        else:
            raise TypeError(f"a {type(value).__name__} has no digest")

    def _add_texture(self, h: Any, file: TextureFile) -> None:
        images = self._textures.get(file, ())
        h.update(f"x{len(images)}:".encode())
        for number, image in images:
            if id(image) not in self._images:
                self._images[id(image)] = self.of(image.loaded())
            h.update(f"{number}:{self._images[id(image)]}".encode())
