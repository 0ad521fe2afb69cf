"""Verification finds what is not as it was: an input, a setting, a version, pixels; and the first of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from primray.dataset import make, verify
from primray.errors import SettingsError

from .room import config_in

pytest.importorskip("yaml", reason="no PyYAML")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make(config_in(tmp_path), tmp_path / "set")
    return tmp_path / "set"


def changed_lock(folder: Path, **changes: Any) -> None:
    path = folder / "dataset.lock.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def test_what_is_as_it_was_is_verified(folder: Path) -> None:
    found = verify(folder, share=1)
    assert (found.difference, found.samples, found.notes) == (None, (0, 1, 2), ())
    assert len(verify(folder, share=0.01).samples) == 1
    assert verify(folder, share=0.5, seed=3).samples == verify(folder, share=0.5, seed=3).samples


def test_it_is_verified_elsewhere(folder: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere/deeper/set"
    moved.parent.mkdir(parents=True)
    folder.rename(moved)
    with pytest.raises(SettingsError, match="there is no file"):
        verify(moved)
    assert verify(moved, inputs=tmp_path).difference is None


def test_a_changed_input_is_found(folder: Path, tmp_path: Path) -> None:
    stage = tmp_path / "room.usda"
    stage.write_text(stage.read_text() + "# a comment\n")
    difference = verify(folder).difference
    assert difference is not None
    assert (difference.kind, difference.what) == ("input", "room.usda")


def test_a_changed_setting_is_found(folder: Path) -> None:
    path = folder / "dataset.yaml"
    plain = json.loads(path.read_text())
    plain["settings"]["spp"] = 3
    path.write_text(json.dumps(plain))
    difference = verify(folder).difference
    assert difference is not None
    assert (difference.kind, difference.what, difference.before, difference.now) == ("setting", "settings.spp", 2, 3)


def test_a_changed_pixel_of_a_picture_is_found(folder: Path) -> None:
    from primray.dataset.packing import read_integers
    from primray.images.image import write_png

    path = folder / "samples/000001/picture.png"
    values = read_integers(path).copy()
    values[3, 4, 1] ^= 1
    write_png(values, path)
    difference = verify(folder, share=1).difference
    assert difference is not None
    assert (difference.kind, difference.what) == ("pixels", str(path))


def test_a_changed_value_of_an_aov_is_found(folder: Path) -> None:
    path = folder / "samples/000002/depth.npy"
    values = np.load(path)
    values[6, 8, 0] += 1
    np.save(path, values)
    difference = verify(folder, share=1).difference
    assert difference is not None
    assert (difference.kind, difference.what) == ("pixels", str(path))


def test_other_pixels_than_the_locks_are_found(folder: Path) -> None:
    lock = json.loads((folder / "dataset.lock.json").read_text())
    lock["samples"]["000001"]["depth"] = "0" * 64
    changed_lock(folder, samples=lock["samples"])
    difference = verify(folder, share=1).difference
    assert difference is not None
    assert difference.kind == "pixels"
    assert "000001" in difference.what


def test_pixels_that_both_files_have_wrong_are_found(folder: Path) -> None:
    """The record and the lock agree, but no render gives that."""
    for path, at in ((folder / "dataset.lock.json", ("samples", "000000")), (folder / "samples/000000/sample.json", ())):
        says = json.loads(path.read_text())
        inner = says
        for name in at:
            inner = inner[name]
        inner["picture" if at else "pixels_sha256"] = "1" * 64
        path.write_text(json.dumps(says))
    difference = verify(folder, share=1).difference
    assert difference is not None
    assert difference.what == "of sample 000000, picture"


def test_versions_that_change_no_pixel_are_a_note_and_those_that_do_are_the_difference(folder: Path) -> None:
    lock = json.loads((folder / "dataset.lock.json").read_text())
    changed_lock(folder, versions={**lock["versions"], "usd": "24.1"}, isa="v1")
    found = verify(folder, share=1)
    assert found.difference is None
    assert [note.split(":")[0] for note in found.notes] == ["isa class of the core", "version usd"]
    samples = {**lock["samples"], "000000": {**lock["samples"]["000000"], "picture": "1" * 64}}
    record = folder / "samples/000000/sample.json"
    record.write_text(record.read_text().replace(lock["samples"]["000000"]["picture"], "1" * 64))
    changed_lock(folder, versions={**lock["versions"], "usd": "24.1"}, isa=lock["isa"], samples=samples)
    difference = verify(folder, share=1).difference
    assert difference is not None
    assert difference.kind == "version"
    assert difference.what.startswith("usd (pixels of sample 000000")


def test_a_sample_that_is_missing_is_found_and_an_unfinished_set_is_refused(folder: Path) -> None:
    (folder / "samples/000001").rename(folder / "gone")
    difference = verify(folder).difference
    assert difference is not None
    assert "000001" in difference.what
    changed_lock(folder, samples={})
    with pytest.raises(SettingsError, match="no complete data set"):
        verify(folder)
