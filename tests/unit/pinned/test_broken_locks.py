"""Locks that are edited, links in their paths, files that pinning may not replace, and AOVs of the picture's file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.cli import run
from primray.errors import SettingsError
from primray.pinned.lock import Lock
from primray.pinned.verification import verify

from .shot import STAGE, changed, write_shot, write_texture

SIZE: dict[str, Any] = {"resolution": (48, 32), "spp": 4, "threads": 2}


def members(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the paths of all members, of lists of their first one."""
    items = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from members(inner, (*path, key))


JUNK: tuple[Any, ...] = (None, 3, -1, 4.5, 2**40, 10**30, float("nan"), "x", "a\0b", [], [1], ["x"], {}, {"a": 1}, True)


def read_or_none(path: Path) -> Lock | None:
    """Return the lock, None if it is refused as none; any other error is one of the test."""
    try:
        return Lock.read(path)[0]
    except SettingsError as error:
        if error.code != "lock-unreadable":
            raise
        return None


def test_no_member_that_is_something_else_is_an_internal_error(tmp_path: Path) -> None:
    """Each member of a lock, exchanged for values of other types, sealed or not: it is read, or refused as no lock."""
    made = primray.pin(write_shot(tmp_path), tmp_path / "a.exr", aovs=["depth"], **SIZE).file
    good, bad = json.loads(made.read_text()), tmp_path / "bad.lock.json"
    refused = 0
    for path in members(good):
        for junk in JUNK:
            found = json.loads(made.read_text())
            inner = found
            for key in path[:-1]:
                inner = inner[key]
            inner[path[-1]] = junk
            bad.write_text(json.dumps(found))
            lock = read_or_none(bad)
            if lock is None:
                refused += 1
                continue
            lock.picture.ends()
            assert lock.picture.grid == (3, 2)
            assert isinstance(lock.stage, str)
            assert all(isinstance(text, str) for text in (*lock.inputs.values(), *lock.scene.values(), lock.isa))
    assert refused > 100
    bad.write_text("[" * 100_000)
    with pytest.raises(SettingsError, match="no lock of a picture"):
        Lock.read(bad)


@pytest.mark.parametrize("seed", ["-1", "0"])
def test_a_seed_is_0_or_more(seed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lock = primray.pin(write_shot(tmp_path), **SIZE).file
    assert run(["verify", str(lock), "--share", "0.1", "--seed", seed]) == (2 if seed == "-1" else 0)
    assert ("a seed is 0 or more" in capsys.readouterr().err) == (seed == "-1")


# Files that are replaced


@pytest.mark.parametrize("output", ["shot.usda", "paint.png", "link.usda"])
def test_a_lock_does_not_replace_what_the_picture_is_made_of(output: str, tmp_path: Path) -> None:
    stage = write_shot(tmp_path)
    (tmp_path / "link.usda").symlink_to(stage)
    before = (tmp_path / output).read_bytes()
    with pytest.raises(SettingsError, match="would overwrite a file that the command reads"):
        primray.pin(stage, lock=tmp_path / output, **SIZE)
    assert (tmp_path / output).read_bytes() == before


def test_a_picture_replaces_neither_a_texture_nor_its_lock(tmp_path: Path) -> None:
    stage = write_shot(tmp_path)
    stage.write_text(STAGE.replace("paint.png", "paint.exr"))
    primray.render(stage, resolution=(8, 8), spp=2).save(tmp_path / "paint.exr")
    before = (tmp_path / "paint.exr").read_bytes()
    with pytest.raises(SettingsError, match="would overwrite a file"):
        primray.pin(stage, tmp_path / "paint.exr", **SIZE)
    with pytest.raises(SettingsError, match="are the same file"):
        primray.pin(stage, tmp_path / "a.exr", lock=tmp_path / "a.exr", **SIZE)
    assert (tmp_path / "paint.exr").read_bytes() == before


# Links


def test_a_stage_that_is_a_link_is_verified(tmp_path: Path) -> None:
    """As in stores of files by their content: the link has the name, and its folder the textures."""
    kept = write_shot(tmp_path / "store").rename(tmp_path / "store/1f3a.usda")
    project = tmp_path / "project"
    project.mkdir()
    (project / "shot.usda").symlink_to(kept)
    write_texture(project, 200)
    lock = primray.pin(project / "shot.usda", project / "a.exr", **SIZE).file
    assert verify(lock, threads=2).is_whole
    (tmp_path / "linked").symlink_to(project)
    assert verify(tmp_path / "linked/a.lock.json", threads=2).is_whole


def test_a_lock_in_a_linked_folder_leads_to_its_stage(tmp_path: Path) -> None:
    """ ".." leads out of where the folder is, not of where its link is."""
    stage, deep = write_shot(tmp_path / "project"), tmp_path / "real/deep/dir"
    deep.mkdir(parents=True)
    (tmp_path / "out").symlink_to(deep)
    lock = primray.pin(stage, tmp_path / "out/a.exr", **SIZE).file
    assert verify(lock, threads=2).is_whole
    assert verify(deep / "a.lock.json", threads=2).is_whole
    here = os.getcwd()
    try:
        os.chdir(tmp_path / "out")
        assert verify("a.lock.json", share=0).difference is None
    finally:
        os.chdir(here)


# What is compared without rendering


@pytest.mark.parametrize("how", [{"share": 0}, {"share": 0, "ranges": True}])
def test_settings_are_compared_though_nothing_is_rendered(how: dict[str, Any], tmp_path: Path) -> None:
    lock = changed(primray.pin(write_shot(tmp_path), **SIZE).file, lambda found: found["settings"].update(filter_width=None))
    found = verify(lock, **how).difference
    assert found is not None
    assert (found.kind, found.what) == ("setting", "filter_width")


@pytest.mark.parametrize("share", [0, 0.2, 1])
def test_an_aov_of_the_file_that_was_changed_is_found(share: float, tmp_path: Path) -> None:
    lock = primray.pin(write_shot(tmp_path), tmp_path / "a.exr", aovs=["depth", "position", "lights"], **SIZE).file
    assert verify(lock, share=share, threads=2).difference is None
    image = primray.read_image(tmp_path / "a.exr")
    depth = np.array(image.aovs["depth"].values)
    depth[3, 5] = 1e-3
    changed_depth = replace(image.aovs["depth"], values=depth)
    replace(image, aovs={**image.aovs, "depth": changed_depth}).save(tmp_path / "a.exr", half=("none",))
    found = verify(lock, share=share, threads=2).difference
    assert found is not None
    assert (found.kind, found.what) == ("picture", f"{tmp_path / 'a.exr'}: AOV depth")


def test_lights_with_errors_and_differences_are_read_again(tmp_path: Path) -> None:
    """The layers of a part are told apart by their channels' names, in whatever order these are."""
    made = primray.pin(write_shot(tmp_path), tmp_path / "a.exr", aovs=["lights"], aov_errors=True, **SIZE)
    read = primray.read_image(tmp_path / "a.exr")
    for name, aov in made.image.aovs.items():
        again = read.aovs[name]
        assert again.channels == aov.channels
        for layer in ("values", "errors", "differences"):
            assert np.array_equal(getattr(again, layer), getattr(aov, layer), equal_nan=True), (name, layer)
    assert any(aov.errors is not None and aov.differences is not None for aov in read.aovs.values())
    assert verify(made.file, threads=2).is_whole
