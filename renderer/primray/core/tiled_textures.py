"""Textures out of core: those whose levels the core reads by tile while it renders, from files of the cache on disk.

Where all images fit the budget they are held whole, as without one. Otherwise small ones are, and the others are read by tile,
with the same values.
"""

from __future__ import annotations

import os
import resource
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..arrays import Floats
from ..errors import AssetError
from ..settings import RenderSettings
from ..textures.texture import Texture
from ..textures.tile_cache import TileCache, tile_cache
from . import compiled

THREADS = 8
WHOLE_BYTES = 128 * 1024  # images whose kept levels need less are always held whole
SPARE_FILES = 256  # files of the process beside those of tiles


@dataclass(frozen=True)
class ImageOfScene:
    """One image of one of the builder's textures, and the channels of it that the texture has."""

    texture: int  # in the builder
    tile: int  # of a UDIM set, or 0
    image: Texture
    channels: str  # "rgb", or one letter
    count: int  # of channels: a grey image may have to be repeated in three

    @property
    def name(self) -> str:
        return f"{self.channels}{self.count}"

    @property
    def cache_key(self) -> str:
        return f"{self.image.content}.{self.name}"


PixelsOf = Callable[[ImageOfScene, Texture], Floats]
OnImage = Callable[[int, int], None]


class TiledTextures:
    """Adds images to a scene, by tile where the budget asks for it."""

    def __init__(self, cache: TileCache, budget_bytes: int) -> None:
        self.cache, self.memory = cache, compiled.TileMemory(budget_bytes)
        self._warnings: list[tuple[str, str, str]] = []

    def are_whole(self, builder: compiled.SceneBuilder, images: Sequence[ImageOfScene]) -> bool:
        """Return whether the levels of all images that rays can ask for fit the budget."""
        return sum(_kept_bytes(builder, one) for one in images) <= self.memory.budget_bytes

    def add(
        self, builder: compiled.SceneBuilder, images: Sequence[ImageOfScene], pixels: PixelsOf, on_image: OnImage | None = None
    ) -> None:
        """Add the images; `pixels(one, texture)` gives the floats (H, W, C) of one, from its texels.

        `on_image` is called with the number of images that have been added, and of all.
        """
        whole = self.are_whole(builder, images)
        wanted = [one for one in images if one.image.content and not whole and _kept_bytes(builder, one) > WHOLE_BYTES]
        files = self._files_of(builder, wanted, pixels)
        _allow_files(len(files))
        for done, one in enumerate(images):
            if on_image is not None:
                on_image(done, len(images))
            path = files.get(id(one))
            memory: compiled.TileMemory | None = self.memory
            if path is None and one.image.loader is not None:
                level = builder.finest_texture_level(one.texture, *_size(one.image))
                path, memory = self.cache.find(one.image.content, one.name, level), None
            if path is None or not self._set_tiles(builder, one, path, memory):
                builder.set_texture_image(one.texture, one.tile, pixels(one, one.image.loaded()))
        for why in self.cache.take_failures():
            message = f"The cache of textures fails, so that they may be held whole in memory: {why}"
            self._warnings.append(("texture-cache", "", message))
        if self.cache.counts.written:
            self.cache.sweep()

    def _set_tiles(
        self, builder: compiled.SceneBuilder, one: ImageOfScene, path: Path, memory: compiled.TileMemory | None
    ) -> bool:
        try:
            builder.set_texture_tiles(one.texture, one.tile, os.fspath(path), one.cache_key, memory=memory)
            return True
        except compiled.CoreError as error:
            code, why = error.args
            if code != "texture-cache":
                raise
            self.cache.fail(f"{why} ({path})")
            self.cache.discard(path)
            return False

    def _files_of(self, builder: compiled.SceneBuilder, images: Sequence[ImageOfScene], pixels: PixelsOf) -> Mapping[int, Path]:
        """Return the files of tiles by the identity of the image, written where they are missing."""
        levels = {id(one): builder.finest_texture_level(one.texture, *_size(one.image)) for one in images}

        def make(one: ImageOfScene) -> Path | None:
            def write(file: int) -> None:
                height, width, channels = one.image.shape
                with self.cache.gate.of(4 * height * width * channels):
                    floats = pixels(one, one.image.loaded())
                    try:
                        compiled.write_tile_file(file, one.cache_key, floats, levels[id(one)])
                    except compiled.CoreError as error:
                        raise OSError(error.args[1]) from error

            return self.cache.make(one.image.content, one.name, levels[id(one)], write)

        with ThreadPoolExecutor(min(THREADS, len(os.sched_getaffinity(0)))) as threads:
            made = list(threads.map(make, images))
        return {id(one): path for one, path in zip(images, made, strict=True) if path is not None}

    def take_warnings(self) -> list[tuple[str, str, str]]:
        """Return what has not been reported yet."""
        warnings, self._warnings = self._warnings, []
        return warnings

    def check(self) -> None:
        """Raise AssetError if a tile could not be read since the last check."""
        if fault := self.memory.take_fault():
            raise AssetError(f"a texture cannot be read from the cache while rendering: {fault}", code="texture-cache-damaged")

    def facts(self) -> dict[str, Any]:
        """Return what was read and kept, for the report."""
        counts = dict(self.memory.counts)
        read_s = counts.pop("read_nanoseconds") / 1e9
        return {"budget_bytes": self.memory.budget_bytes, **counts, "read_s": read_s, "cache": self.cache.facts()}


GROWING = ("tiles_read", "bytes_read", "read_s", "tiles_evicted", "found", "written", "written_bytes", "removed")


def facts_since(now: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, Any]:
    """Return facts whose counts begin at those of `before`."""
    found: dict[str, Any] = {}
    for name, value in now.items():
        if isinstance(value, Mapping):
            found[name] = facts_since(value, before[name])
        else:
            found[name] = value - before[name] if name in GROWING else value
    return found


def tiled_textures(settings: RenderSettings) -> TiledTextures | None:
    """Return the textures out of core of the process, where the settings ask for a budget."""
    cache = tile_cache(settings)
    return None if cache is None or settings.texture_memory_bytes is None else _tiled(cache, settings.texture_memory_bytes)


@lru_cache(maxsize=8)
def _tiled(cache: TileCache, budget_bytes: int) -> TiledTextures:
    return TiledTextures(cache, budget_bytes)


def _size(image: Texture) -> tuple[int, int]:
    height, width, _ = image.shape
    return width, height


def _kept_bytes(builder: compiled.SceneBuilder, one: ImageOfScene) -> int:
    """Return the bytes of the levels that rays can ask for; of float files at most."""
    width, height = _size(one.image)
    level = builder.finest_texture_level(one.texture, width, height)
    texels = max(width >> level, 1) * max(height >> level, 1) * 4 // 3
    return texels * one.count * (4 if one.image.stored.dtype.kind == "f" else 2)


def _allow_files(count: int) -> None:
    """Raise the limit of open files: each image that is read by tile has its own."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = count + SPARE_FILES
    if soft != resource.RLIM_INFINITY and soft < needed:
        allowed = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, allowed), hard))
