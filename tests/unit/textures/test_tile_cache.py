"""The texture cache on disk: what names an entry, what is written when, and whatever goes wrong with it."""

from __future__ import annotations

import errno
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from primray.color.color_space import REC709
from primray.description import TextureFile, Wrap
from primray.errors import AssetError
from primray.textures import tile_cache
from primray.textures.texture import Texture, load_texture
from primray.textures.tile_cache import TileCache

CHANNELS = frozenset("rgb")
SIZE = 512


def write_image(path: Path, seed: int = 0, size: int = SIZE, wrap: str = "") -> Path:
    texels = np.random.default_rng(seed).integers(0, 256, (size, size, 3)).astype(np.uint8)
    spec = oiio.ImageSpec(size, size, 3, "uint8")
    if wrap:
        spec.attribute("wrapmodes", wrap)
    file = oiio.ImageOutput.create(str(path))
    assert file
    assert file.open(str(path), spec)
    assert file.write_image(texels)
    file.close()
    os.utime(path, ns=(10**18, 10**18 + seed))  # long ago
    return path


def cache_of(folder: Path, memory: int = 1 << 30, most: int = 1 << 30) -> TileCache:
    return TileCache(folder / "cache", memory, most)


def load(cache: TileCache, path: Path, channels: frozenset[str] = CHANNELS, file: TextureFile | None = None) -> Texture:
    return cache.load(file or TextureFile(str(path), "sRGB"), str(path), channels, None, Wrap.BLACK)


def put_tiles(cache: TileCache, texture: Texture, level: int = 0, data: bytes = b"tiles") -> Path | None:
    return cache.make(texture.content, "rgb3", level, lambda file: os.write(file, data))


def test_texels_come_from_the_file_until_its_levels_are_there(tmp_path: Path) -> None:
    path, cache = write_image(tmp_path / "a.tif", wrap="clamp,clamp"), cache_of(tmp_path)
    direct = load_texture(TextureFile(str(path), "sRGB"), channels=CHANNELS)
    first = load(cache, path)
    assert first.loader is None
    np.testing.assert_array_equal(first.stored, direct.stored)
    assert load(cache, path).loader is None  # a header alone saves nothing: texels are needed
    assert put_tiles(cache, first) is not None
    again = load(cache_of(tmp_path), path)
    assert again.loader is not None
    assert again.stored.strides == (0, 0, 0)
    assert (again.shape, again.stored.dtype, again.content) == (direct.shape, np.uint8, first.content)
    assert (again.srgb_channels, again.wrap_s, again.wrap_t) == (3, direct.wrap_s, direct.wrap_t)
    np.testing.assert_array_equal(again.pixels, direct.pixels)
    np.testing.assert_array_equal(again.channels(1, 2), direct.channels(1, 2))


def test_an_entry_is_named_by_content_and_conversion_not_by_path_or_time(tmp_path: Path) -> None:
    cache = cache_of(tmp_path)
    one, same, other = write_image(tmp_path / "a.tif"), tmp_path / "b.tif", write_image(tmp_path / "c.tif", 1)
    shutil.copyfile(one, same)  # a file written anew has the time of day in it
    os.utime(same, ns=(10**18, 10**18))
    keys = [load(cache, path).content for path in (one, same, other)]
    assert keys[0] == keys[1] != keys[2]
    os.utime(one)
    assert load(cache, one).content == keys[0]
    for space in ("raw", "auto", REC709):
        assert load(cache, one, file=TextureFile(str(one), space)).content != keys[0]
    assert load(cache, one, channels=frozenset("r")).content != keys[0]
    write_image(one, 2)
    assert load(cache, one).content != keys[0]


def test_a_file_that_may_change_within_its_time_stamp_is_always_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tile_cache, "SETTLED_NS", 600 * 10**9)  # whatever else the machine does
    path, cache = write_image(tmp_path / "a.tif"), cache_of(tmp_path)
    load(cache, path)
    notes = tmp_path / "cache" / "contents"
    assert len(list(notes.iterdir())) == 1
    os.utime(path)
    load(cache, path)
    assert len(list(notes.iterdir())) == 1


def test_small_images_are_not_kept(tmp_path: Path) -> None:
    cache = cache_of(tmp_path)
    texture = load(cache, write_image(tmp_path / "a.tif", size=64))
    assert texture.content == ""


def test_texels_wait_in_memory_up_to_the_budget(tmp_path: Path) -> None:
    cache = cache_of(tmp_path, memory=SIZE * SIZE * 3 + 1)
    paths = [write_image(tmp_path / f"{k}.tif", k) for k in range(3)]
    one, two = load(cache, paths[0]), load(cache, paths[1])
    assert one.loader is None
    assert two.loader is not None
    np.testing.assert_array_equal(two.pixels, load_texture(TextureFile(str(paths[1]), "sRGB"), channels=CHANNELS).pixels)
    del one
    assert load(cache, paths[2]).loader is None


def test_a_file_that_changes_before_it_is_read_again_is_an_error(tmp_path: Path) -> None:
    path = write_image(tmp_path / "a.tif")
    texture = load(cache_of(tmp_path, memory=0), path)
    write_image(path, 1)
    with pytest.raises(AssetError, match="changed"):
        texture.loaded()


def test_finer_levels_take_the_place_of_coarser_ones(tmp_path: Path) -> None:
    cache = cache_of(tmp_path)
    texture = load(cache, write_image(tmp_path / "a.tif"))
    coarse = put_tiles(cache, texture, 3)
    assert coarse is not None
    assert coarse.name == "rgb3.3.tiles"
    assert put_tiles(cache, texture, 4) == coarse  # which has that level too
    assert cache.find(texture.content, "rgb3", 2) is None
    fine = put_tiles(cache, texture, 1)
    assert fine is not None
    assert not coarse.exists()
    assert cache.find(texture.content, "rgb3", 5) == fine
    assert cache.counts.written == 2
    assert cache.counts.found == 1


def test_a_full_disk_leaves_nothing_behind_and_is_noted(tmp_path: Path) -> None:
    cache = cache_of(tmp_path)
    texture = load(cache, write_image(tmp_path / "a.tif"))

    def full(file: int) -> None:
        os.write(file, b"half of it")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    assert cache.make(texture.content, "rgb3", 0, full) is None
    assert any("No space left" in why for why in cache.take_failures())
    assert cache.take_failures() == []
    assert not list((tmp_path / "cache").rglob("*.tmp"))
    assert cache.find(texture.content, "rgb3", 0) is None


def test_a_folder_that_cannot_be_made_costs_no_picture(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("in the way")
    cache = cache_of(tmp_path)
    texture = load(cache, write_image(tmp_path / "a.tif"))
    assert texture.stored.size == SIZE * SIZE * 3
    assert put_tiles(cache, texture) is None
    assert cache.take_failures()


def test_what_was_not_used_lately_is_removed_first(tmp_path: Path) -> None:
    cache = cache_of(tmp_path, most=130_000)
    textures = [load(cache, write_image(tmp_path / f"{k}.tif", k)) for k in range(3)]
    paths = [put_tiles(cache, texture, data=bytes(40_000)) for texture in textures]
    for age, path in zip((300, 200, 100), paths, strict=True):
        assert path is not None
        os.utime(path, (time.time() - age,) * 2)
    assert paths[1] is not None
    open_file = open(paths[1], "rb")  # noqa: SIM115 - stays open while it is removed
    assert cache.find(textures[0].content, "rgb3", 0) == paths[0]  # used now
    cache.sweep()
    assert [path is not None and path.exists() for path in paths] == [True, False, True]
    assert len(open_file.read()) == 40_000
    open_file.close()
    assert cache.counts.removed >= 1


def test_files_of_killed_writers_are_removed_and_those_of_living_ones_are_not(tmp_path: Path) -> None:
    script = textwrap.dedent(f"""
        import os, time
        from pathlib import Path
        from primray.textures.tile_cache import TileCache
        cache = TileCache(Path({str(tmp_path / "cache")!r}), 1 << 20, 1 << 30)
        def slow(file):
            os.write(file, b"half")
            print("begun", flush=True)
            time.sleep(60)
        cache.make("ab" * 32, "rgb3", 0, slow)
    """)
    writer = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert writer.stdout
    assert writer.stdout.readline() == "begun\n"
    (left,) = (tmp_path / "cache").rglob("*.tmp")
    os.utime(left, (1, 1))
    cache = cache_of(tmp_path)
    cache.sweep()
    assert left.exists()
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    cache.sweep()
    assert not left.exists()
    # The lock of the killed process is free.
    start = time.monotonic()
    assert cache.make("ab" * 32, "rgb3", 0, lambda file: os.write(file, b"whole")) is not None
    assert time.monotonic() - start < 5


def _write_all(folder: str, seed: int, results: object) -> None:
    cache = TileCache(Path(folder), 1 << 20, 1 << 30)

    def write(file: int) -> None:
        for _ in range(20):
            os.write(file, b"x" * 1000)
            time.sleep(0.001)

    for k in range(8):
        path = cache.make(f"{k:02}" + "cd" * 31, "rgb3", 0, write)
        results.put(path is not None and path.read_bytes() == b"x" * 20_000)  # type: ignore[attr-defined]
    results.put(cache.counts.written)  # type: ignore[attr-defined]


def test_processes_that_write_the_same_entries_at_once_write_each_once(tmp_path: Path) -> None:
    start = multiprocessing.get_context("spawn")
    results = start.Queue()
    writers = [start.Process(target=_write_all, args=(str(tmp_path / "cache"), k, results)) for k in range(4)]
    for writer in writers:
        writer.start()
    found = [results.get(timeout=60) for _ in range(4 * 9)]
    for writer in writers:
        writer.join()
    assert [one for one in found if isinstance(one, bool)] == [True] * 32
    assert sum(one for one in found if not isinstance(one, bool)) == 8
