"""A pinned picture is verified elsewhere; each thing that is broken on purpose is found, and named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.errors import SettingsError
from primray.images.image import pixels_sha256
from primray.pinned.difference import Difference
from primray.pinned.lock import SHORT, hashes_of_tiles
from primray.pinned.verification import Verification, verify

from .shot import changed, write_shot, write_texture

SIZE: dict[str, Any] = {"resolution": (48, 32), "threads": 2}


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    return primray.pin(write_shot(tmp_path / "set"), tmp_path / "shot.exr", spp=16, aovs=["depth"], **SIZE).file


def difference_of(lock: Path, **how: Any) -> Difference:
    found = verify(lock, threads=2, **how)
    assert found.difference is not None
    assert not found.is_whole
    return found.difference


def with_other_pixel(picture: Path) -> None:
    """Change one bit of one number of the picture: that of least weight of green at 21, 18."""
    image = primray.read_image(picture)
    pixels = np.array(image.pixels)
    pixels.view(np.uint32)[18, 21, 1] ^= 1
    replace(image, pixels=pixels).save(picture)


# What is as it was


def test_a_picture_is_verified_whole_and_by_share(lock: Path) -> None:
    found = verify(lock, threads=2)
    assert (found.difference, found.is_whole, found.pixels, found.samples) == (None, True, 48 * 32, 48 * 32 * 16)
    assert found.file == str(lock.parent / "shot.exr")
    assert found.notes == ()
    part = verify(lock, share=0.3, seed=5, threads=2)
    assert (part.difference, len(part.tiles), part.of, part.pixels, part.samples) == (None, 2, 6, 512, 512 * 16)
    assert part.notes == ("AOVs were not compared, which takes the whole picture",)
    assert part.tiles == verify(lock, share=0.3, seed=5, threads=2).tiles


def test_a_lock_says_what_a_report_says(lock: Path, tmp_path: Path) -> None:
    """The pixels are those of any render with these settings."""
    image = primray.render(tmp_path / "set/shot.usda", spp=16, **SIZE)
    found = json.loads(lock.read_text())
    assert found["picture"]["pixels_sha256"] == image.report["pixels_sha256"]
    assert sorted(found["inputs"]) == ["paint.png", "shot.usda"]
    assert "threads" not in found["settings"]


def test_it_is_verified_where_the_folder_was_moved(lock: Path, tmp_path: Path) -> None:
    inside = tmp_path / "set/shot.lock.json"
    inside.write_text(json.dumps({**json.loads(lock.read_text()), "stage": "shot.usda", "file": "../shot.exr"}))
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "set").rename(tmp_path / "elsewhere/deep")
    (tmp_path / "shot.exr").rename(tmp_path / "elsewhere/shot.exr")
    assert verify(tmp_path / "elsewhere/deep/shot.lock.json", threads=2).is_whole
    with pytest.raises(SettingsError, match="no such stage"):
        verify(lock)
    elsewhere = tmp_path / "elsewhere"
    assert verify(lock, stage=elsewhere / "deep/shot.usda", picture=elsewhere / "shot.exr", threads=2).is_whole


def test_counts_of_adaptive_sampling_are_replayed_in_tiles_alone(tmp_path: Path) -> None:
    """Counts come from the whole frame's errors, which a tile alone does not have."""
    stage = write_shot(tmp_path)
    made = primray.pin(stage, tmp_path / "a.exr", spp=64, target_error=1e-9, resolution=(80, 48), threads=2)
    assert len({tuple(pair) for pair in made.lock.picture.counts}) > 1
    assert verify(made.file, share=0.2, threads=2).difference is None
    assert verify(made.file, threads=2).is_whole


def test_a_region_and_a_stopped_render_are_verified(tmp_path: Path) -> None:
    stage = write_shot(tmp_path)
    region: Any = {"region": (0.3, 0.2, 0.9, 0.9), "filter": "gaussian", "time_limit_s": 0.2}
    made = primray.pin(stage, tmp_path / "a.exr", **SIZE, **region)
    assert made.lock.picture.origin != (0, 0)
    assert verify(made.file, threads=2).is_whole


# What is broken


@pytest.mark.parametrize("share", [1, 0])
def test_a_texel_is_found_and_what_it_changes(lock: Path, tmp_path: Path, share: float) -> None:
    write_texture(tmp_path / "set", 201)
    found = difference_of(lock, share=share)
    assert (found.kind, found.what) == ("input", "paint.png (it changes material /World/paint)")
    assert found.before != found.now


def test_a_layer_that_changes_nothing_is_found_and_said_so(lock: Path, tmp_path: Path) -> None:
    stage = tmp_path / "set/shot.usda"
    stage.write_text(stage.read_text() + "# a comment\n")
    assert difference_of(lock).what == "shot.usda (nothing that is rendered changes)"
    stage.write_text(stage.read_text().replace("intensity = 30", "intensity = 31"))
    assert difference_of(lock).what == "shot.usda (it changes light /World/lamp)"
    stage.write_text(stage.read_text().replace('Sphere "ball"', 'Sphere "ball" (references = @./new.usda@)'))
    assert difference_of(lock).kind == "input"


def test_an_input_that_is_gone_and_one_that_is_new_are_found(lock: Path, tmp_path: Path) -> None:
    (tmp_path / "set/paint.png").rename(tmp_path / "set/other.png")
    found = difference_of(lock)
    assert (found.kind, found.now) == ("input", None)
    assert found.what.startswith("paint.png")


def test_an_edited_lock_is_found_by_its_seals(lock: Path) -> None:
    changed(lock, lambda found: found["settings"].update(seed=1), sealed=False)
    assert str(difference_of(lock)) == "lock section settings: its seal when it was made, other contents now"


def test_a_setting_that_means_something_else_now_is_found(lock: Path) -> None:
    changed(lock, lambda found: found["settings"].update(filter_width=None))
    found = difference_of(lock)
    assert (found.kind, found.what, found.before, found.now) == ("setting", "filter_width", None, 1.0)


def test_a_prim_that_is_translated_otherwise_is_found(lock: Path) -> None:
    changed(lock, lambda found: found["scene"].update({"shape /World/ball": "0" * 16}))
    found = difference_of(lock)
    assert (found.kind, found.what, found.before) == ("scene", "shape /World/ball", "0" * 16)


@pytest.mark.parametrize("share", [1, 0.01])
def test_one_bit_of_one_pixel_of_the_picture_is_found(lock: Path, tmp_path: Path, share: float) -> None:
    with_other_pixel(tmp_path / "shot.exr")
    found = difference_of(lock, share=share)
    assert found.kind == "picture"
    assert found.what == f"{tmp_path / 'shot.exr'}: pixel 21, 18"
    assert np.float32(found.before[1]).view(np.uint32) ^ np.float32(found.now[1]).view(np.uint32) == 1


def test_without_rendering_the_tile_of_that_pixel_is_found(lock: Path, tmp_path: Path) -> None:
    assert verify(lock, share=0).notes == ("no pixel was rendered again",)
    with_other_pixel(tmp_path / "shot.exr")
    assert difference_of(lock, share=0).what.endswith("pixels 16:32, 16:32")
    assert verify(lock, share=0, picture=False).difference is None


def test_a_forged_hash_is_found_as_the_locks(lock: Path) -> None:
    changed(lock, lambda found: found["picture"]["tiles"].__setitem__(2, "0" * 64))
    found = difference_of(lock)
    assert (found.kind, found.before) == ("lock", "0" * 64)
    assert found.what.startswith("hash of pixels 32:48, 0:16: the picture's file and the render have the same bits")


def test_a_forged_hash_of_the_whole_is_found(lock: Path) -> None:
    changed(lock, lambda found: found["picture"].update(pixels_sha256="0" * 64))
    assert difference_of(lock).what.startswith("pixels_sha256")


def test_a_picture_that_is_forged_with_its_lock_is_found(lock: Path, tmp_path: Path) -> None:
    """File and lock agree, in every hash, but no render gives that."""
    with_other_pixel(tmp_path / "shot.exr")
    pixels = primray.read_image(tmp_path / "shot.exr").pixels

    def forge(found: dict[str, Any]) -> None:
        found["picture"] |= {"tiles": hashes_of_tiles(pixels), "pixels_sha256": pixels_sha256(pixels)}

    changed(lock, forge)
    found = difference_of(lock)
    assert (found.kind, found.what) == ("pixels", "pixel 21, 18, hash of all samples alone (code or machine)")


def test_samples_that_differ_are_found_by_their_pass(lock: Path) -> None:
    def forge(found: dict[str, Any]) -> None:
        found["picture"]["tiles"][4] = "0" * 64
        last = found["picture"]["passes"][-1]
        last["tiles"] = last["tiles"][: 4 * SHORT] + "0" * SHORT + last["tiles"][5 * SHORT :]

    changed(lock, forge)
    found = difference_of(lock, picture=False)
    assert (found.kind, found.what) == ("pixels", "pixels 16:32, 16:32, samples 8 to 16 (code or machine)")


def test_ranges_of_samples_are_verified_alone(lock: Path) -> None:
    found = verify(lock, ranges=True, seed=1, threads=2)
    assert found.difference is None
    assert not found.is_whole
    assert [tile for tile, _, _ in found.ranges] == list(range(6))
    assert {(first, end) for _, first, end in found.ranges} == {(0, 8), (8, 16)}
    part = verify(lock, share=0.3, ranges=True, seed=5, threads=2)
    assert len(part.ranges) == 2
    assert part.as_json()["ranges"] == [list(each) for each in part.ranges]


def test_a_range_that_differs_is_named(lock: Path) -> None:
    def forge(found: dict[str, Any]) -> None:
        for row in found["picture"]["passes"]:
            row["tiles"] = row["tiles"][: 2 * SHORT] + "0" * SHORT + row["tiles"][3 * SHORT :]

    changed(lock, forge)
    assert verify(lock, threads=2).difference is None  # the picture is right; its ranges were not asked for
    found = difference_of(lock, ranges=True, seed=1)
    assert found.kind == "pixels"
    ranges = ["samples 0 to 8", "samples 8 to 16"]
    assert found.what in [f"pixels 32:48, 0:16, {each} (code or machine)" for each in ranges]


def test_ranges_of_adaptive_pictures_are_those_of_each_tile(tmp_path: Path) -> None:
    shot, asked = write_shot(tmp_path / "set"), {"target_error": 3e-4, **SIZE}
    pinned = primray.pin(shot, lock=tmp_path / "shot.lock.json", **asked)
    whole = primray.render(shot, progress=False, **asked)
    assert np.array_equal(pinned.image.pixels, whole.pixels), "passes that are rendered apart are the picture to the bit"
    assert len(pinned.lock.picture.counts) > 1, "tiles have other numbers of samples"
    found = verify(pinned.file, ranges=True, threads=2)
    assert found.difference is None
    assert len({end for _, _, end in found.ranges}) > 1


def test_an_aov_that_differs_is_found(lock: Path) -> None:
    changed(lock, lambda found: found["aovs"].update(depth="0" * 64))
    assert difference_of(lock, picture=False).what == "AOV depth (code or machine)"
    found = difference_of(lock)
    assert found.kind == "lock"
    assert found.what.startswith("hash of AOV depth: the picture's file and the render have the same values")


def test_versions_are_a_note_and_to_blame_where_pixels_differ(lock: Path) -> None:
    changed(lock, lambda found: found["versions"].update(usd="24.1"))
    changed(lock, lambda found: found.update(isa="v1"))
    found = verify(lock, threads=2)
    assert found.is_whole
    assert [note.split(":")[0] for note in found.notes] == [
        "the same pixels, though isa class of the core",
        "the same pixels, though version usd",
    ]
    changed(lock, lambda found: found["picture"]["tiles"].__setitem__(0, "0" * 64))
    difference = difference_of(lock, picture=False)
    assert difference.kind == "isa"
    assert difference.what.startswith("class of the core (pixels pixels 0:16, 0:16")


def test_a_picture_that_is_missing_or_of_another_size_is_found(lock: Path, tmp_path: Path) -> None:
    image = primray.read_image(tmp_path / "shot.exr")
    (tmp_path / "shot.exr").unlink()
    assert str(difference_of(lock)) == f"picture {tmp_path / 'shot.exr'}: there when it was made, not there now"
    replace(image, pixels=image.pixels[:16], errors=None, frame=None, aovs={}).save(tmp_path / "shot.exr")
    assert difference_of(lock).now == [48, 16]


# Random tiles


def test_the_chance_to_miss_wrong_tiles_is_the_one_that_is_said() -> None:
    """A third of 60 tiles is wrong; five random ones are all right for (2/3)^5 of seeds, less what no repetition gains."""
    random = np.random.default_rng(1)
    wrong = set(range(20))
    missed = sum(not wrong & set(random.choice(60, 5, replace=False).tolist()) for _ in range(4000)) / 4000
    found = Verification(None, tiles=(1, 2, 3, 4, 5), of=60)
    assert found.chance_to_miss(1 / 3) == pytest.approx((2 / 3) ** 5)
    assert found.chance_to_miss(1 / 3) - 0.03 < missed < found.chance_to_miss(1 / 3)
    assert Verification(None, tiles=(0, 1), of=2).chance_to_miss(0.1) == 0


def test_a_wrong_share_of_tiles_is_found_by_random_ones(lock: Path) -> None:
    """Half of the tiles have forged hashes: of ten seeds with three tiles each, the chance that two miss them is 0.06."""

    def forge(found: dict[str, Any]) -> None:
        found["picture"]["tiles"] = ["0" * 64 if k % 2 else tile for k, tile in enumerate(found["picture"]["tiles"])]

    changed(lock, forge)
    missed = [seed for seed in range(10) if verify(lock, share=0.5, seed=seed, picture=False, threads=2).difference is None]
    assert len(missed) <= 1


# What cannot be asked for


def test_bad_requests_are_refused(lock: Path, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"a share is 0 to 1, not 1\.5"):
        verify(lock, share=1.5)
    with pytest.raises(SettingsError, match="it is no lock of a picture"):
        verify(tmp_path / "set/shot.usda")
    with pytest.raises(SettingsError, match="cannot be read: No such file"):
        verify(tmp_path / "none")

    changed(lock, lambda found: found["picture"]["counts"].append([1]))
    with pytest.raises(SettingsError, match="counts of samples are missing"):
        verify(lock)
    changed(lock, lambda found: found["picture"]["tiles"].pop())
    with pytest.raises(SettingsError, match="hashes of tiles are missing"):
        verify(lock)


def test_pictures_that_no_film_has_are_not_pinned(tmp_path: Path) -> None:
    stage = write_shot(tmp_path)
    for refused in ({"background": "#fff"}, {"ground": "shadow"}, {"sample_range": (0, 4)}, {"aovs": ["deep"]}):
        with pytest.raises(SettingsError) as caught:
            primray.pin(stage, None, **SIZE, **refused)
        assert caught.value.code == "pin-setting"
    with pytest.raises(SettingsError, match="is an EXR"):
        primray.pin(stage, tmp_path / "a.png", **SIZE)
    with pytest.raises(SettingsError, match="needs the stage's path"):
        primray.pin(object(), **SIZE)  # type: ignore[arg-type]
