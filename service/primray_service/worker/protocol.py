"""Protocol between a server and a worker: one JSON object a line, commands to its stdin, messages from its stdout.

The first command names the chunk; a worker runs one chunk and ends, unless the command asks it to stay: then it sends `ready`
after `done`, and another chunk of the same job may come. Paths are relative: those of commands to the job folder, which is
read-only, those of messages to the output folder. The server validates every message before it uses it.

Commands
    {"do": "check", "file": "shot.usdz" | "package", "kind": "usda|usdc|usdz|zip", "entry": "shot.usda" | null, "limits": {..}}
    {"do": "render", "file": "package/shot.usda", "settings": {RenderSettings as JSON}, "checkpoint": "checkpoint.prc" | null,
     "number": 3, "checkpoint_every_s": 10, "picture_only": false, "preview": true, "limits": {..}, "traceparent": "..",
     "outputs": ["beauty.exr", "beauty.png", "report.json"], "spent_s": 3.5, "fraction": 0.4,
     "part": false, "stay": true, "files": {"exposure": 1.5, ..},
     "products": {"named": ["/Render/beauty", ..] | null, "name_end": ".0012"}}
        resumes from `checkpoint` (whose number is `number`), or begins; `picture_only`: take no more samples, write the
        outputs; `preview`: like the command of that name, from the start; `outputs`: names of files, whose extensions
        determine their formats; `spent_s`: earlier seconds of sampling that count towards the settings' time limit;
        `fraction`: progress reported before; `stay`: after `done`, for another chunk;
        `files`: members of FileSettings; `products`: all or those named, in files of their own names with suffix `name_end`;
        `part`: the settings name a range of samples; take them and leave a checkpoint, without previews and without a picture
        (then: checkpoint, done with no outputs and a report {"stop", "samples", "rays"})
    {"do": "merge", "parts": ["checkpoint.prc", "part-8.prc"], "number": 3, "metric": "relmse", "target": 0.01 | null,
     "limits": {..}}
        merges disjoint parts (then: checkpoint, preview, row, done with no outputs and a report {"samples", "parts":
        {"ranges": [[0, 64]], "rays", "error", "target_met"}})
    {"do": "spot-check", "file", "settings", "part": "part.prc", "number": 0, "tiles": 32, "seed": "2a..", "limits": {..}}
        renders random tiles of another machine's part again (then: if they have the same bits, checkpoint with what is known of
        the scene here; done with no outputs and a report {"parts": {"fault": null | "pixels .."}})
    {"do": "explain", "file", "settings", "pixel": [x, y], "stay": true, "limits": {..}}
        explains a pixel of the picture (then: done with no outputs; its report is the JSON of `primray explain`, with `more`)
    {"do": "stop"}     end soon with a checkpoint and the picture so far           (then: checkpoint, done; done with no outputs
                       and a report {"interrupted": true, "samples": 0} if there is no picture yet)
    {"do": "yield"}    end soon with a checkpoint                                  (then: checkpoint, yielded)
    {"do": "preview"}  write a preview soon, and for the next ten seconds after each pass

Messages, by "at"
    ready      slow imports are done; it waits for a command
    phase      {"phase": "opening|translating|building|sampling|writing"}
    effective  {"settings": {..}, "features": [..], "scene": {counts}, "resolution": [w, h]}: after resolving scene and request
    warning    {"code", "prim", "detail", "severity", "kind", "attribute"}
    progress   {"fraction", "samples_done" (mean a pixel), "samples_min", "samples_max", "rays", "rays_per_s", "elapsed_s"
    (sampling),
                "error": {"metric", "estimate", "ci95", "target", "kind": "estimated"} | null, "eta_s" | null, "eta_ci95" |
                null, "pass"}
    row        a row of the convergence curve: {"t_s", "samples", "relmse", "ci95", "rmse"}
    preview    {"pass", "file", "bytes", "samples"}: worker/preview.py describes the file; passes increase
    checkpoint {"number": 4, "file", "bytes", "samples", "seconds"}: replaces number 3
    facts      {..}: results of a check
    done       {"outputs": [{"name", "file", "bytes", "sha256", "media_type"}], "report": {..}}
               (the report without its diagnostics, which were warnings: the file has them)
    yielded    {"number": 4}
    failed     {"problem": {"type": "/problems/..", "title", "status", "detail", ...}}
After done (unless it stays), yielded, facts or failed a worker exits with 0; any other end is a crash. Between `done` and
the next chunk it ignores commands.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

MAX_LINE_BYTES = 4 * 2**20

PHASES = ("opening", "translating", "building", "sampling", "writing")
WORK = ("check", "render", "merge", "spot-check", "explain")
LAST = ("facts", "done", "yielded", "failed")

Check = Callable[[Any], bool]
MOST_TEXT = 4096
MOST_DEPTH = 32


class BadMessage(ValueError):
    """The worker's line is not a message."""


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and abs(value) < 1e300


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


def _text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MOST_TEXT


def _object(value: Any) -> bool:
    return isinstance(value, dict)


def _list(value: Any) -> bool:
    return isinstance(value, list)


def _file(value: Any) -> bool:
    """Return whether the value is the plain name of a file in the output folder."""
    return _text(value) and 0 < len(value) <= 255 and not value.startswith(".") and not set(value) & set("/\\\0\n\r")


def _sha256(value: Any) -> bool:
    return isinstance(value, str) and len(value) == 64 and not set(value) - set("0123456789abcdef")


def _or_null(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _pair(check: Check) -> Check:
    return lambda value: isinstance(value, list) and len(value) == 2 and all(map(check, value))


def _members(**checks: Check) -> Check:
    """Return a check for an object that has at least these members."""
    return lambda value: isinstance(value, dict) and all(name in value and check(value[name]) for name, check in checks.items())


def _each(check: Check) -> Check:
    return lambda value: isinstance(value, list) and all(map(check, value))


_OUTPUT = _members(name=_file, file=_file, bytes=_count, sha256=_sha256, media_type=_text)
_ERROR = _members(metric=_text, estimate=_number, ci95=_pair(_or_null(_number)), kind=_text)
_PROBLEM = _members(type=_text, title=_text, status=_count, detail=_text)

SHAPES: Mapping[str, Check] = {
    "ready": _members(),
    "phase": _members(phase=lambda value: value in PHASES),
    "effective": _members(settings=_object, features=_list, scene=_object, resolution=_pair(_count)),
    "warning": _members(code=_text, prim=_text, detail=_text, severity=_text, kind=_text, attribute=_text),
    "progress": _members(
        fraction=lambda value: _number(value) and 0 <= value <= 1,
        samples_done=_number,
        samples_min=_count,
        samples_max=_count,
        rays=_count,
        rays_per_s=_number,
        elapsed_s=_number,
        error=_or_null(_ERROR),
        eta_s=_or_null(_number),
        eta_ci95=_or_null(_pair(_or_null(_number))),
        **{"pass": _count},
    ),
    "row": _members(t_s=_number, samples=_number, relmse=_number, ci95=_pair(_or_null(_number)), rmse=_number),
    "preview": _members(file=_file, bytes=_count, **{"pass": _count}),
    "checkpoint": _members(number=_count, file=_file, bytes=_count, samples=_number, seconds=_number),
    "facts": _members(),
    "done": _members(outputs=_each(_OUTPUT), report=_object),
    "yielded": _members(number=_count),
    "failed": _members(problem=_PROBLEM),
}


def parse(line: bytes) -> dict[str, Any]:
    """Return the message of a line; raises BadMessage if it is none."""
    if len(line) > MAX_LINE_BYTES:
        raise BadMessage(f"a line of more than {MAX_LINE_BYTES} bytes")
    try:
        message = json.loads(line, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise BadMessage("a line that is not JSON") from error
    if not isinstance(message, dict) or not isinstance(message.get("at"), str):
        raise BadMessage("a line that is not a message")
    check = SHAPES.get(message["at"])
    if check is None:
        raise BadMessage(f"an unknown message {message['at'][:40]!r}")
    if not check(message) or _depth(message) > MOST_DEPTH:
        raise BadMessage(f"a malformed message {message['at']!r}")
    return message


def _no_constant(name: str) -> float:
    raise ValueError(name)


def _depth(value: Any) -> int:
    if isinstance(value, dict):
        return 1 + max(map(_depth, value.values()), default=0)
    return 1 + max(map(_depth, value), default=0) if isinstance(value, list) else 0
