"""Manifests of packages: equal files at equal paths are one scene, and a list that no package could have is refused."""

from __future__ import annotations

import hashlib

import pytest

from primray_service.limits import Limits
from primray_service.problems import Problem
from primray_service.scenes.contents import FileOfPackage, Part, manifest_of, read_manifest

A, B, C = "a" * 64, "b" * 64, "c" * 64
EMPTY = hashlib.sha256(b"").hexdigest()
SHOT, IMAGE = FileOfPackage("shot.usda", A, 10), FileOfPackage("textures/wood.png", B, 20)


def test_the_scene_does_not_depend_on_order_or_name() -> None:
    one, two = (manifest_of(files, name, Limits()) for files, name in (([SHOT, IMAGE], "one.zip"), ([IMAGE, SHOT], "two.zip")))
    assert one.scene_id == two.scene_id
    assert one.scene_id != manifest_of([SHOT], "one.zip", Limits()).scene_id
    assert (one.bytes, one.sizes, one.joined_bytes) == (30, {A: 10, B: 20}, 0)


def test_it_is_read_as_it_was_written() -> None:
    usdz = FileOfPackage("car.usdz", C, 30, (Part(A, 10), Part(B, 20)))
    made = manifest_of([usdz, FileOfPackage("none.txt", EMPTY, 0)], "car", Limits())
    again = read_manifest(made.text, "car")
    assert (again.scene_id, again.sizes, again.joined_bytes) == (made.scene_id, {A: 10, B: 20}, 30)
    assert [file.path for file in again.files] == ["car.usdz", "none.txt"]


@pytest.mark.parametrize(
    ("files", "slug"),
    [
        ([IMAGE], "not-usd"),
        ([SHOT, FileOfPackage("other.usda", A, 11)], "invalid-request"),
        ([SHOT, FileOfPackage("none.txt", EMPTY, 1)], "invalid-request"),
        ([FileOfPackage("car.usdz", C, 31, (Part(A, 10), Part(B, 20)))], "invalid-request"),
        ([SHOT, FileOfPackage("../outside.usda", B, 20)], "package-unsafe"),
        ([SHOT, FileOfPackage("SHOT.usda", B, 20)], "package-unsafe"),
    ],
)
def test_lists_that_no_package_could_have(files: list[FileOfPackage], slug: str) -> None:
    with pytest.raises(Problem) as caught:
        manifest_of(files, "", Limits())
    assert caught.value.slug == slug
