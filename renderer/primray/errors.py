"""The errors that primray raises: one tree, each with a stable code, an actionable message, and where it occurred.

    PrimrayError
      SceneError             the input is wrong: StageOpenError, AssetError, InvalidSceneError, UnsupportedError
      SettingsError          the request is wrong: unknown camera, impossible resolution
        CheckpointError      a checkpoint is missing, damaged or from a different render
      LimitError             a stated limit was reached: memory, triangles, texture size
      RenderCancelled        the caller cancelled; not a fault
      InternalError          a defect in primray: a failed core invariant, an unexpected Embree code

`exit_code` is the exit status of the command line; docs/exit-codes.md documents all of them, including 5 and 6, which belong to
no error.
"""

from __future__ import annotations

from collections.abc import Iterable


class PrimrayError(Exception):
    """Base class of all errors.

    `code` is stable across releases. `where` is a prim path, an asset, a layer or a setting, or "" for the request as a whole.

    >>> try:
    ...     primray.render("shot.usda", spp=0)
    ... except primray.PrimrayError as error:
    ...     print(error.code, error.where, error.exit_code)
    settings-error spp 2
    """

    code = "error"
    exit_code = 1

    def __init__(self, message: str, *, where: str = "", code: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.where = where
        if code is not None:
            self.code = code

    def __str__(self) -> str:
        place = f" [{self.where}]" if self.where else ""
        return f"{self.code}: {self.message}{place}"


class SceneError(PrimrayError):
    code = "scene-error"
    exit_code = 3


class StageOpenError(SceneError):
    code = "stage-open"


class AssetError(SceneError):
    code = "asset-error"


class InvalidSceneError(SceneError):
    code = "invalid-scene"


class UnsupportedError(SceneError):
    """The scene has something that cannot be rendered; `refused` holds the diagnostics refused by `strict` or `fail_on`."""

    code = "unsupported"
    refused: tuple[dict[str, str], ...] = ()


class SettingsError(PrimrayError):
    code = "settings-error"
    exit_code = 2


class CheckpointError(SettingsError):
    code = "checkpoint"


class LimitError(PrimrayError):
    code = "limit"
    exit_code = 4


class RenderCancelled(PrimrayError):
    code = "cancelled"
    exit_code = 130


class InternalError(PrimrayError):
    code = "internal"
    exit_code = 1


def did_you_mean(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """Return "did you mean X?" for the known name closest to `name`, or `otherwise` if none is close."""
    from difflib import get_close_matches

    near = get_close_matches(name, list(known), 1)
    return f"did you mean {near[0]}?" if near else otherwise
