"""Images that are read by tile have the bits of those held whole, whatever the budget and however many threads."""

from __future__ import annotations

import os
import random
import threading
from pathlib import Path

import numpy as np
import pytest
from tests.described import kernels

from primray.core import compiled

IMAGES = 60
LEAST = 1 << 20  # bytes that tiles may always have
WRAPS = range(4)
LANES = (0, 1)


def pixels_of(r: random.Random) -> np.ndarray:
    """Sizes with one tile and many, square and not, odd; all three formats, one channel or three."""
    noise = np.random.default_rng(r.randrange(2**32))
    width, height = (r.choice([1, 3, 31, 32, 33, 63, 64, 65, 127, 130, 257, 300, 512]) for _ in range(2))
    channels = r.choice([1, 3])
    values = noise.random((height, width, channels), np.float32)
    kind = r.choice(["unorm", "half", "float"])
    if kind == "unorm":
        return (np.round(values * 65535) / 65535).astype(np.float32)
    return values * np.float32(3 if kind == "half" else 1e6) - np.float32(1)


def places_of(r: random.Random, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates inside and outside, on the border, far away; levels between and beyond those that there are."""
    noise = np.random.default_rng(r.randrange(2**32))
    st = noise.uniform(-1.2, 2.2, (count, 2)).astype(np.float32)
    st[: count // 4] = noise.integers(-2, 3, (count // 4, 2)) / np.float32(2)
    st[-3:] = [[1e30, -1e30], [np.nan, 0.5], [0.999999, 1.000001]]
    levels = noise.uniform(-3, 11, count).astype(np.float32)
    levels[: count // 3] = np.floor(levels[: count // 3])
    return st, levels


def write(path: Path, key: str, pixels: np.ndarray, first: int) -> None:
    with open(path, "wb") as file:
        compiled.write_tile_file(file.fileno(), key, pixels, first)


@pytest.mark.parametrize("seed", range(4))
def test_lookups_by_tile_have_the_bits_of_whole_images(tmp_path: Path, seed: int) -> None:
    r = random.Random(seed)
    memory = compiled.TileMemory(LEAST)  # for all images: tiles are evicted
    seen = []
    for number in range(IMAGES // 4):
        pixels, first = pixels_of(r), r.choice([0, 0, 1, 3])
        first = min(first, max(pixels.shape[:2]).bit_length() - 1)
        path, key = tmp_path / f"{number}.tiles", f"key {number}"
        write(path, key, pixels, first)
        by_tile = kernels().TextureImage(str(path), key, memory, first)
        whole = kernels().TextureImage(str(path), key, None, first)
        seen.append(by_tile)
        for wraps in {(r.choice(WRAPS), r.choice(WRAPS)) for _ in range(3)}:
            st, levels = places_of(r, 500)
            for lanes in LANES:
                wanted = kernels().texture_lookup(pixels, *wraps, first, st, levels, lanes)
                for image in (by_tile, whole, r.choice([by_tile, whole])):
                    found = kernels().image_lookup(image, *wraps, st, levels, lanes)
                    assert found.tobytes() == wanted.tobytes(), (pixels.shape, wraps, lanes)
    counts = memory.counts
    assert counts["tiles_evicted"] > 0
    assert counts["resident_bytes"] <= LEAST
    assert counts["peak_bytes"] <= LEAST + 4 * 64 * 64 * 3  # one more while it is admitted
    assert memory.take_fault() == ""


def test_threads_that_evict_each_other_s_tiles_read_the_same(tmp_path: Path) -> None:
    noise = np.random.default_rng(5)
    memory = compiled.TileMemory(LEAST)
    pixels = [noise.random((700, 900, 3), np.float32) * 3 for _ in range(2)]  # 2 x 10 MB: ten times the budget
    images = []
    for number, one in enumerate(pixels):
        write(tmp_path / str(number), "key", one, 0)
        images.append(kernels().TextureImage(str(tmp_path / str(number)), "key", memory, 0))
    st = noise.random((20_000, 2), np.float32)
    levels = np.zeros(len(st), np.float32)
    wanted = [kernels().texture_lookup(one, 2, 2, 0, st, levels, 0).tobytes() for one in pixels]
    wrong: list[int] = []

    def read(number: int) -> None:
        for k in range(3):
            which = (number + k) % 2
            if kernels().image_lookup(images[which], 2, 2, st, levels, 0).tobytes() != wanted[which]:
                wrong.append(number)

    threads = [threading.Thread(target=read, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert memory.counts["tiles_evicted"] > 1000
    assert memory.counts["resident_bytes"] <= LEAST


def test_memory_stays_within_the_budget(tmp_path: Path) -> None:
    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    pixels = np.random.default_rng(1).random((2048, 2048, 3), np.float32)  # 34 MB
    write(tmp_path / "a", "key", pixels, 0)
    st = np.random.default_rng(2).random((50_000, 2), np.float32)
    levels = np.zeros(len(st), np.float32)
    memory = compiled.TileMemory(4 << 20)
    image = kernels().TextureImage(str(tmp_path / "a"), "key", memory, 0)
    kernels().image_lookup(image, 2, 2, st[:10], levels[:10], 0)
    before = resident()
    kernels().image_lookup(image, 2, 2, st, levels, 0)
    assert resident() - before < 8 << 20
    del image
    assert memory.counts["resident_bytes"] == 0
    assert memory.counts["images"] == 0


def test_damage_is_found(tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).random((200, 200, 1), np.float32)
    path = tmp_path / "a"
    write(path, "key", pixels, 0)
    whole = path.read_bytes()

    def refused(data: bytes, key: str = "key", first: int = 0) -> str:
        other = tmp_path / "b"
        other.write_bytes(data)
        with pytest.raises(compiled.CoreError) as error:
            kernels().TextureImage(str(other), key, compiled.TileMemory(LEAST), first)
        assert error.value.args[0] == "texture-cache"
        return str(error.value.args[1])

    assert "another image" in refused(whole, "other")
    assert "size" in refused(whole[:-1])
    assert "short" in refused(whole[:100])
    assert "version" in refused(b"x" + whole[1:])
    assert "damaged" in refused(whole[:150] + bytes([whole[150] ^ 1]) + whole[151:])  # the width
    write(path, "key", pixels, 2)
    assert "levels" in refused(path.read_bytes(), first=1)


def test_a_tile_that_cannot_be_read_is_a_fault_and_not_a_crash(tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).random((300, 300, 1), np.float32)
    path = tmp_path / "a"
    write(path, "key", pixels, 0)
    memory = compiled.TileMemory(LEAST)
    image = kernels().TextureImage(str(path), "key", memory, 0)
    os.truncate(path, 4096 + 8192)  # as no process of ours does
    st = np.full((1, 2), 0.9, np.float32)
    kernels().image_lookup(image, 2, 2, st, np.zeros(1, np.float32), 0)
    assert str(path) in memory.take_fault()
    assert memory.take_fault() == ""
