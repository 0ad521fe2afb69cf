"""Options of an EXR file: their JSON, and the names that a header may have."""

from __future__ import annotations

import json
from typing import Any

import pytest

from primray.description.picture_file import (
    PLAIN,
    Contents,
    PictureFile,
    PictureView,
    is_free_in_header,
    picture_file_of_json,
)


@pytest.mark.parametrize(
    "file",
    [
        PLAIN,
        PictureFile(("R", "depth"), "dwaa", 45.0, (("shot", "a/b"), ("take", 3), ("gain", 0.5), ("slate", (1, 2)))),
        PictureFile(contents=Contents(("R", "G", "B"), (("Z", "depth"),)), products=(("/p", PictureFile(compression="piz")),)),
        PictureFile(lit_behind=True, view=PictureView("Raw", "sRGB", None, -1.5)),
    ],
)
def test_it_comes_back_from_json(file: PictureFile) -> None:
    assert picture_file_of_json(json.loads(json.dumps(file.as_json()))) == file


@pytest.mark.parametrize(
    "wrong",
    [
        {"compression": "gif"},
        {"half": [1]},
        {"level": True},
        {"level": float("nan")},
        {"header": {"a": None}},
        {"view": {"view": 1}},
    ],
)
def test_what_is_no_file_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises((TypeError, ValueError)):
        picture_file_of_json(PLAIN.as_json() | wrong)


def test_another_picture_of_the_view_has_its_own_channels() -> None:
    view = PictureView("Raw")
    assert PictureFile(("R",), "dwaa", 45.0, (("a", 1),), lit_behind=True, view=view).beside() == PictureFile(
        lit_behind=True, view=view
    )


@pytest.mark.parametrize(
    ("name", "free"),
    [
        ("shot", True),
        ("exif:model", True),
        ("", False),
        ("1st", False),
        ("dataWindow", False),
        ("data:window", False),
        ("primray:camera", False),
        ("cryptomatte/1/name", False),
        ("x" * 256, False),
    ],
)
def test_names_of_a_header(name: str, free: bool) -> None:
    assert is_free_in_header(name) is free
