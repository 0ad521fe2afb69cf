"""Names of products' files within a job."""

from __future__ import annotations

import pytest

from primray.errors import SettingsError
from primray_service.dispatcher.chunks.messages import FILE_NAME
from primray_service.worker.product_task import names_within_job


@pytest.mark.parametrize(
    ("files", "time_code", "end", "names"),
    [
        (["beauty.exr"], None, "", ["beauty.exr"]),
        (["beauty.exr", "/abs/depth.EXR", "../mask.png"], None, "-2", ["beauty-2.exr", "depth-2.exr", "mask-2.png"]),
        (["a/shot.exr", "b/shot.exr"], 7.0, ".0007", ["a_shot.0007.exr", "b_shot.0007.exr"]),
        (["shot.####.exr"], 7.0, "-3.0007", ["shot-3.0007.exr"]),
        (["$F4_shot.exr"], 7.0, ".0007", ["0007_shot.0007.exr"]),
        (["shot.####.###.exr"], 1.5, ".0001.500", ["shot.0001.500.exr"]),
        (["Sch\u00f6n & gut..x.exr", "\u5f71.exr", "-.exr"], None, "", ["Schon_gut.x.exr", "picture.exr", "picture_2.exr"]),
        (["Shot.exr", "shot.EXR"], None, "", ["Shot.exr", "shot_2.exr"]),
        (["x" * 180 + ".exr"], None, "", ["x" * 60 + ".exr"]),
    ],
)
def test_names_are_plain_and_differ(files: list[str], time_code: float | None, end: str, names: list[str]) -> None:
    found = names_within_job(files, time_code, end)
    assert found == names
    for name in found:
        assert FILE_NAME.fullmatch(name)
        assert ".." not in name
        assert name.rpartition(".")[0].endswith(end)


def test_a_place_for_the_frame_needs_a_frame() -> None:
    with pytest.raises(SettingsError, match="give the frames to render"):
        names_within_job(["shot.####.exr"], None, "")
