"""What the files of a frame are called."""

from __future__ import annotations

from dataclasses import replace

import pytest

from primray_service.dispatcher.chunks.commands import output_names
from primray_service.jobs import Frame, Job, JobState

FRAME = Frame("job_1", 0, None)
JOB = Job("job_1", "t", JobState.RUNNING, "sha256:0", None, {"stop": {}}, 0.0, 0.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("time_code", "frames", "attempt", "name"),
    [
        (None, 1, 1, "beauty.exr"),
        (7.0, 1, 1, "beauty.0007.exr"),
        (7.0, 2, 1, "beauty.0007.exr"),
        (12345.0, 2, 1, "beauty.12345.exr"),
        (-3.0, 2, 1, "beauty.-003.exr"),
        (1.5, 2, 1, "beauty.0001.500.exr"),
        (7.0, 2, 3, "beauty-3.0007.exr"),
    ],
)
def test_names_of_outputs(time_code: float | None, frames: int, attempt: int, name: str) -> None:
    assert output_names(replace(JOB, attempt=attempt), replace(FRAME, time_code=time_code), frames)[0] == name
