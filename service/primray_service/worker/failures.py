"""Problem documents for a worker's exceptions, with locations inside the job's own files.

Sentences are the renderer's own, so that a service says what the command line says.
"""

from __future__ import annotations

import errno
import re
from pathlib import PurePosixPath
from typing import Any

from primray import errors

from ..problems import Problem

_PLACE = re.compile(r":(\d+):(\d+): ")  # line and column, after the layer's path
_LIMITS = {"memory-limit": "memory-limit", "out-of-memory": "memory-limit", "limit": "limit-exceeded"}
_DISK = {errno.EFBIG, errno.EDQUOT, errno.ENOSPC}


def is_expected(error: BaseException) -> bool:
    """Return whether the error explains itself without a traceback."""
    return isinstance(error, Problem | errors.PrimrayError) and not isinstance(error, errors.InternalError)


def problem_of_error(error: BaseException, job_folder: str) -> Problem:
    """Return the problem that tells a client what happened; the log has the details."""
    if isinstance(error, Problem):
        return error
    if isinstance(error, MemoryError):
        return Problem("memory-limit", "The worker ran out of memory.")
    if isinstance(error, OSError) and error.errno in _DISK:
        return Problem("storage-limit", f"A file could not be written: {error.strerror}.")
    if not isinstance(error, errors.PrimrayError):
        return Problem("render-failed", "The renderer failed with an unexpected error; see the log.")
    return _of_primray(error, job_folder)


def _of_primray(error: errors.PrimrayError, job_folder: str) -> Problem:
    where = _inside(error, job_folder)
    place: dict[str, Any] = {"code": error.code} | ({"where": where} if where else {})
    if isinstance(error, errors.StageOpenError):
        return unreadable_layer(error, where, job_folder)
    if isinstance(error, errors.CheckpointError):
        return Problem("checkpoint-unusable", _sentence(error, job_folder), code=error.code)
    if isinstance(error, errors.SettingsError):
        return Problem("settings-rejected", _sentence(error, job_folder), **place)
    if isinstance(error, errors.LimitError):
        return Problem(_LIMITS.get(error.code, "scene-too-large"), _sentence(error, job_folder), **place)
    if isinstance(error, errors.UnsupportedError) and error.code in ("strict", "fail-on"):
        sentence = _sentence(error, job_folder).removeprefix(f"--{error.code}: ")
        return Problem("strict-warnings", sentence, prim=error.where)
    if isinstance(error, errors.SceneError):
        return Problem("scene-rejected", _sentence(error, job_folder), **place)
    if error.code == "write-failed" and isinstance(error.__cause__, OSError) and error.__cause__.errno in _DISK:
        return Problem("storage-limit", "A file could not be written: it exceeds the limit or the free space.")
    return Problem("render-failed", _sentence(error, job_folder), code=error.code)


def unreadable_layer(error: errors.StageOpenError, layer: str, job_folder: str) -> Problem:
    """Return the problem of an unreadable layer, with USD's own sentence, and the position in the layer if USD gives it."""
    found = _PLACE.search(error.message)
    line, column = (int(found[1]), int(found[2])) if found else (None, None)
    detail = _sentence(error, job_folder)
    return Problem("layer-unreadable", detail, layer=layer, line=line, column=column, code=error.code)


def _sentence(error: errors.PrimrayError, job_folder: str) -> str:
    text = error.message.replace(job_folder + "/", "")[:1000]
    return text[:1].upper() + text[1:]


def _inside(error: errors.PrimrayError, job_folder: str) -> str:
    """Return the location as the client knows it: a path below the job's folder, or a prim path; for another file only its
    name."""
    where = error.where
    if where.startswith(job_folder + "/"):
        return where[len(job_folder) + 1 :]
    is_file = isinstance(error, errors.StageOpenError | errors.AssetError)
    return PurePosixPath(where).name if is_file else where[:1000]
