"""Process that renders one part of a frame: `python -m primray.render.part`, with its task as a line of JSON on stdin.

It writes the part's checkpoint, or prints the error as JSON on stdout. Any other end is a crash.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..checkpoints.checkpointing import Checkpointing
from ..diagnostics import Diagnostics
from ..errors import LimitError, PrimrayError, SceneError, SettingsError
from ..report.report import Costs
from ..settings import RenderSettings, settings_of_json
from .prepare import open_once, prepare

NEVER_S = 1e9  # interval of checkpoints before the end
_BY_EXIT_CODE = {error.exit_code: error for error in (SceneError, SettingsError, LimitError)}


def render_part(stage: str, settings: RenderSettings, file: Path) -> None:
    """Render the part's samples only: pictures and AOVs are made from the whole frame."""
    saving, diagnostics = Checkpointing(file, every_s=NEVER_S), Diagnostics()
    saving.check()
    opened = open_once(stage, settings)
    prepared = prepare(opened.stage, opened.diagnostics, settings, Costs(), diagnostics, fingerprinted=True)
    _, saved = saving.run(prepared, list(diagnostics), lambda fraction, samples, rays: None)
    if why := saved["failed"]:
        raise PrimrayError(why, where=str(file), code="write-failed")


def error_as_json(error: PrimrayError) -> dict[str, Any]:
    return {"code": error.code, "message": error.message, "where": error.where, "exit_code": error.exit_code}


def error_of_json(told: Mapping[str, Any]) -> PrimrayError:
    """Return the error of a part's process as an exception."""
    kind = _BY_EXIT_CODE.get(told["exit_code"], PrimrayError)
    return kind(told["message"], where=told["where"], code=told["code"])


def main() -> None:
    order = json.loads(sys.stdin.readline())
    try:
        render_part(order["stage"], settings_of_json(order["settings"]), Path(order["file"]))
    except PrimrayError as error:
        print(json.dumps(error_as_json(error)))


if __name__ == "__main__":
    main()
