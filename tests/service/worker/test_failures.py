"""What a worker's errors are called on the outside: no path of the server, nothing that a file says, no traceback."""

from __future__ import annotations

import errno
import json

import pytest

from primray import errors
from primray_service.problems import KINDS, Problem
from primray_service.worker.failures import is_expected, problem_of_error

JOB = "/data/slots/x/job"


def document(error: BaseException) -> dict[str, object]:
    found = problem_of_error(error, JOB).as_json()
    assert JOB not in json.dumps(found)
    return found


def with_cause(error: errors.PrimrayError, cause: BaseException) -> errors.PrimrayError:
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "slug"),
    [
        (errors.StageOpenError("USD cannot open it", where=f"{JOB}/a.usda"), "layer-unreadable"),
        (errors.SettingsError("no camera /cam"), "settings-rejected"),
        (errors.CheckpointError("it is damaged", where=f"{JOB}/checkpoint.prc"), "checkpoint-unusable"),
        (errors.LimitError("too much", code="memory-limit"), "memory-limit"),
        (errors.LimitError("too much", code="out-of-memory"), "memory-limit"),
        (errors.LimitError("too many", code="too-large"), "scene-too-large"),
        (errors.LimitError("too many sublayers", code="sublayer-limit", where=f"{JOB}/a.usda"), "scene-too-large"),
        (errors.LimitError("too many pixels"), "limit-exceeded"),
        (errors.UnsupportedError("--strict: motion: ...", code="strict", where="/World"), "strict-warnings"),
        (errors.InvalidSceneError(f"a bad asset {JOB}/x.png"), "scene-rejected"),
        (errors.InternalError("an invariant"), "render-failed"),
        (MemoryError(), "memory-limit"),
        (OSError(errno.ENOSPC, "No space left on device"), "storage-limit"),
        (OSError(errno.EFBIG, "File too large"), "storage-limit"),
        (OSError(errno.EACCES, "Permission denied", f"{JOB}/x"), "render-failed"),
        (
            with_cause(errors.PrimrayError("it cannot be written", code="write-failed"), OSError(errno.EFBIG, "")),
            "storage-limit",
        ),
        (KeyError("x"), "render-failed"),
        (Problem("package-unsafe", "no"), "package-unsafe"),
    ],
)
def test_every_error_has_its_problem(error: BaseException, slug: str) -> None:
    found = document(error)
    assert found["type"] == f"/problems/{slug}"
    assert found["status"] == KINDS[slug].status
    assert found["detail"]


def test_a_syntax_error_has_its_layer_and_line_and_usds_sentence() -> None:
    text = f"USD cannot open it: {JOB}/sub/a.usda:17:3: Expected }} at 'string x = ...' in </World> [{JOB}/sub/a.usda]"
    found = document(errors.StageOpenError(text, where=f"{JOB}/sub/a.usda"))
    assert (found["layer"], found["line"], found["column"], found["code"]) == ("sub/a.usda", 17, 3, "stage-open")
    assert "sub/a.usda:17:3: Expected } at 'string x = ...' in </World>" in str(found["detail"])
    assert str(JOB) not in json.dumps(found)


def test_a_file_elsewhere_is_named_without_its_folder() -> None:
    found = document(errors.StageOpenError("There is no such file.", where="/srv/private/there.usda"))
    assert "private" not in json.dumps(found)


def test_a_prim_is_named_as_it_is() -> None:
    assert document(errors.InvalidSceneError("bad", where="/World/mesh.points"))["where"] == "/World/mesh.points"


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (Problem("not-usd", "x"), True),
        (errors.SettingsError("x"), True),
        (errors.InternalError("x"), False),
        (KeyError(), False),
    ],
)
def test_tracebacks_are_for_what_nobody_expected(error: BaseException, expected: bool) -> None:
    assert is_expected(error) is expected
