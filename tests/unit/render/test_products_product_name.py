"""Product names are data of a stage: whatever they say, the file lies where the caller puts it."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

import pytest

from primray.images.image import check_output_path
from primray.render.frames import name_of_frame
from primray.render.products import place_left_out, product_path, safe_product_name

NAMES = {
    "beauty.exr": "beauty.exr",
    "beauty": "beauty.exr",
    "beauty.PNG": "beauty.PNG",
    "beauty.jpeg": "beauty.jpeg",
    "beauty.tif": "beauty.tif",
    "beauty.tga": "beauty.exr",
    "shot.0001": "shot.0001.exr",
    "key.v2": "key.v2.exr",
    "out/render/beauty.exr": "beauty.exr",
    "/etc/cron.d/x": "x.exr",
    "out/../../x": "x.exr",
    "..\\..\\windows\\x.exr": "x.exr",
    "C:\\x.exr": "x.exr",
    "C:x.exr": "x.exr",
    "file:///tmp/x.exr": "x.exr",
    ".bashrc": "bashrc.exr",
    "-rf.exr": "rf.exr",
    "~.exr": "fallback.exr",
    "": "fallback.exr",
    ".": "fallback.exr",
    "..": "fallback.exr",
    "a/": "fallback.exr",
    ".exr": "exr.exr",
    "   ": "fallback.exr",
    "a\x00b\n.exr": "a_b_.exr",
    'a<b>:"|?*.exr': "a_b______.exr",
    "con": "_con.exr",
    "NUL.exr": "_NUL.exr",
    "com1.x.exr": "_com1.x.exr",
    "a\u202eb": "a_b.exr",
    "\ud800": "?".replace("?", "_") + ".exr",
    "schön": "schön.exr",
    "a.####.exr": "a.####.exr",
    "a.<F4>.exr": "a.$F4.exr",
    "a..exr": "a.exr",
}


@pytest.mark.conforms("RenderProduct.productName")
@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_names(name: str) -> None:
    assert safe_product_name(name, "fallback") == NAMES[name]


@pytest.mark.parametrize(
    "name", [*NAMES, "x" * 5000, "ö" * 5000, "." * 300 + "a", "a" * 250 + ".exr"], ids=lambda n: ascii(n[:20])
)
def test_every_name_can_be_written(name: str, tmp_path: Path) -> None:
    safe = safe_product_name(name, "fallback")
    assert len(PurePosixPath(safe).parts) == len(PureWindowsPath(safe).parts) == 1
    assert len(safe.encode()) < 200
    assert safe == safe_product_name(safe, "other")  # once is enough
    path = check_output_path(tmp_path / safe)
    path.with_name(name_of_frame(safe, 3.0)).touch()


def test_a_bad_default_is_made_safe_too() -> None:
    assert safe_product_name("", "/a/b") == "b.exr"
    assert safe_product_name("", "..") == "picture.exr"


PATHS = {
    "out/render/beauty.exr": "out/render/beauty.exr",
    "/farm/shot/x": "/farm/shot/x.exr",
    "out/../../x": "../x.exr",
    "..\\..\\windows\\x.exr": "../../windows/x.exr",
    "C:\\x.exr": "x.exr",
    "C:a/x.exr": "a/x.exr",
    "file:///farm/x.exr": "/farm/x.exr",
    "s3://bucket/a/x.exr": "bucket/a/x.exr",
    "~/x.exr": "_/x.exr",
    ".cache/x.exr": ".cache/x.exr",
    "a/": "a/fallback.exr",
    "": "fallback.exr",
    "a\x00b/c?d/x.exr": "a_b/c_d/x.exr",
    "seq.v2/x.<F4>.exr": "seq.v2/x.$F4.exr",
}


@pytest.mark.parametrize("name", PATHS, ids=ascii)
def test_paths(name: str) -> None:
    assert product_path(name, "fallback") == PATHS[name]
    assert bool(place_left_out(name)) == name.startswith(("C:", "s3:"))


@pytest.mark.parametrize("name", [*NAMES, *PATHS, f"{'x' * 5000}/{'ö' * 5000}/a.png"], ids=lambda n: ascii(n[:20]))
def test_the_file_of_a_path_is_a_safe_name(name: str) -> None:
    path = PurePosixPath(product_path(name, "fallback"))
    assert path.name == safe_product_name(path.name, "other")
    assert all(len(part.encode()) < 200 and part == part.strip("\x00\n") for part in path.parts)
    assert product_path(str(path), "other") == str(path)
