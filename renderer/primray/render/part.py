"""One part of a frame in a process of its own: `python -m primray.render.part`, told by a line of JSON on stdin.

It leaves the part's checkpoint, or says as JSON on stdout what went wrong. Any other end is a crash.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..checkpoints.checkpointing import Checkpointing
from ..errors import LimitError, PrimrayError, SceneError, SettingsError
from ..settings import settings_of_json
from .render import quiet_frames

_BY_EXIT_CODE = {error.exit_code: error for error in (SceneError, SettingsError, LimitError)}


def render_part(stage: str, settings: Mapping[str, Any], file: Path) -> None:
    saving = Checkpointing(file, every_s=1e9)
    image = next(quiet_frames(stage, [settings_of_json(settings)], checkpointing=[saving]))
    if why := image.report["checkpoint"]["failed"]:
        raise PrimrayError(why, where=str(file), code="write-failed")


def error_as_json(error: PrimrayError) -> dict[str, Any]:
    return {"code": error.code, "message": error.message, "where": error.where, "exit_code": error.exit_code}


def error_of_json(told: Mapping[str, Any]) -> PrimrayError:
    """What went wrong there, as it would be raised here."""
    kind = _BY_EXIT_CODE.get(told["exit_code"], PrimrayError)
    return kind(told["message"], where=told["where"], code=told["code"])


def main() -> None:
    order = json.loads(sys.stdin.readline())
    try:
        render_part(order["stage"], order["settings"], Path(order["file"]))
    except PrimrayError as error:
        print(json.dumps(error_as_json(error)))


if __name__ == "__main__":
    main()
