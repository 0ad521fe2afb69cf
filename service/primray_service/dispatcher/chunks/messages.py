"""Validation of workers' messages: a worker has read untrusted input, so nothing that it sends is trusted.

Texts lose characters that a database or a terminal cannot take, numbers are checked, and sizes are bounded. An inbox holds a
chunk's messages that are not yet processed: the newest of a kind that supersedes older ones, else all in order.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...jobs import Json
from ...problems import KINDS
from ...worker.protocol import PHASES
from . import messages

FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
SLUG = re.compile(r"[a-z0-9-]{1,60}")
SHA256 = re.compile(r"[0-9a-f]{64}")
MEDIA_TYPE = re.compile(r"[a-z]+/[a-z0-9.+-]{1,60}")
MOST_OUTPUTS = 64
MOST_VALUES = 50_000  # per message, including nested values
MOST_DEPTH = 12
TEXT_CHARS = 4000
# Members of a render's report that are kept in results; the complete report is one of the outputs.
OF_REPORT = (
    *("stop", "samples", "rays", "error", "convergence", "sampling_s", "stages_s", "pixels_sha256", "interrupted"),
    *("invalid_samples", "isa", "threads", "versions", "settings", "parts", "denoised"),
)


class NotBelieved(Exception):
    """The message is not one that our worker sends."""


@dataclass(frozen=True)
class Checkpoint:
    number: int
    file: str


@dataclass(frozen=True)
class Preview:
    number: int  # of the pass that it shows
    file: str


@dataclass(frozen=True)
class MadeFile:
    """A file that a worker claims to have made."""

    name: str
    file: str
    sha256: str
    media_type: str


@dataclass(frozen=True)
class Done:
    outputs: tuple[MadeFile, ...]
    report: Json


@dataclass(frozen=True)
class Yielded:
    pass


@dataclass(frozen=True)
class Failed:
    problem: Json


def clean_text(value: object, most: int = TEXT_CHARS) -> str:
    """Return the text without control characters (PostgreSQL refuses NUL) and lone surrogates (not UTF-8)."""
    if not isinstance(value, str):
        raise NotBelieved("a text is missing")
    return "".join(c if _is_text(c) else "?" for c in value[:most])


def _is_text(character: str) -> bool:
    if character < " ":
        return character in "\n\t"
    return character != "\x7f" and not "\ud800" <= character <= "\udfff"


def clean(value: object) -> Any:
    """Return a JSON value that can be stored; raises NotBelieved for non-finite numbers and for values that are too large."""
    left = MOST_VALUES

    def cleaned(item: object, depth: int) -> Any:
        nonlocal left
        left -= 1
        if left < 0 or depth > MOST_DEPTH:
            raise NotBelieved("a message is too large")
        if item is None or isinstance(item, bool):
            return item
        if isinstance(item, str):
            return clean_text(item)
        if isinstance(item, int | float):
            return number(item)
        if isinstance(item, Mapping):
            return {clean_text(name, 200): cleaned(inner, depth + 1) for name, inner in item.items()}
        if isinstance(item, list | tuple):
            return [cleaned(inner, depth + 1) for inner in item]
        raise NotBelieved("a message is not JSON")

    return cleaned(value, 0)


def number(value: object) -> float | int:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or abs(value) > 1e300:
        raise NotBelieved("a number is missing")
    return value


def whole(value: object, most: int = 2**53) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise NotBelieved("a whole number is missing")
    return value


def mapping(value: object) -> Json:
    """Return a cleaned JSON object."""
    if not isinstance(value, Mapping):
        raise NotBelieved("an object is missing")
    found: Json = clean(value)
    return found


def file_name(value: object) -> str:
    """Return the plain name of a file in the worker's output folder."""
    if not isinstance(value, str) or not FILE_NAME.fullmatch(value) or ".." in value:
        raise NotBelieved("a file's name is not one of ours")
    return value


def phase_of(message: Mapping[str, Any]) -> str:
    phase = message.get("phase")
    if phase not in PHASES:
        raise NotBelieved("unknown phase")
    return str(phase)


_PROGRESS = ("samples_done", "samples_min", "samples_max", "rays", "rays_per_s", "elapsed_s", "pass")


def progress_of(message: Mapping[str, Any]) -> Json:
    """Return a frame's progress with the protocol's members only."""
    found: Json = {"fraction": min(max(float(number(message.get("fraction"))), 0.0), 1.0)}
    for name in _PROGRESS:
        if message.get(name) is not None:
            found[name] = number(message[name])
    found["error"] = None if message.get("error") is None else _error_of(message["error"])
    found["eta_s"] = None if message.get("eta_s") is None else max(number(message["eta_s"]), 0)
    found["eta_ci95"] = None if message.get("eta_ci95") is None else _interval_of(message["eta_ci95"])
    return found


def _error_of(value: object) -> Json:
    error = mapping(value)
    return {
        "metric": clean_text(error.get("metric"), 20),
        "estimate": number(error.get("estimate")),
        "ci95": _interval_of(error.get("ci95")),
        "target": None if error.get("target") is None else number(error["target"]),
        "kind": clean_text(error.get("kind", "estimated"), 20),
    }


def _interval_of(value: object) -> list[float | int]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise NotBelieved("an interval is missing")
    return [number(value[0]), number(value[1])]


def row_of(message: Mapping[str, Any]) -> Json:
    """Return a row of the convergence curve."""
    found: Json = {name: number(message.get(name)) for name in ("t_s", "samples", "relmse")}
    if message.get("ci95") is not None:
        found["ci95"] = _interval_of(message["ci95"])
    if message.get("rmse") is not None:
        found["rmse"] = number(message["rmse"])
    return found


def warning_of(message: Mapping[str, Any]) -> Json:
    found = {
        "code": clean_text(message.get("code"), 100),
        "prim": clean_text(message.get("prim") or "", 1024),
        "detail": clean_text(message.get("detail") or ""),
    }
    for name, most in (("severity", 20), ("kind", 20), ("attribute", 1024)):
        if message.get(name) is not None:
            found[name] = clean_text(message[name], most)
    return found


def checkpoint_of(message: Mapping[str, Any]) -> Checkpoint:
    return Checkpoint(whole(message.get("number")), file_name(message.get("file")))


def preview_of(message: Mapping[str, Any]) -> Preview:
    return Preview(whole(message.get("pass")), file_name(message.get("file")))


def done_of(message: Mapping[str, Any]) -> Done:
    outputs = message.get("outputs")
    if not isinstance(outputs, list) or len(outputs) > MOST_OUTPUTS:
        raise NotBelieved("the outputs are missing")
    made = tuple(_made_of(mapping(item)) for item in outputs)
    if len({item.name for item in made}) != len(made) or len({item.file for item in made}) != len(made):
        raise NotBelieved("two outputs have one name")
    report = message.get("report")
    if not isinstance(report, Mapping):
        raise NotBelieved("the report is missing")
    return Done(made, {name: clean(report[name]) for name in OF_REPORT if name in report})


def _made_of(item: Json) -> MadeFile:
    sha256, media_type = item.get("sha256"), item.get("media_type")
    if not isinstance(sha256, str) or not SHA256.fullmatch(sha256):
        raise NotBelieved("an output's digest is missing")
    if not isinstance(media_type, str) or not MEDIA_TYPE.fullmatch(media_type):
        raise NotBelieved("an output's media type is missing")
    return MadeFile(file_name(item.get("name")), file_name(item.get("file")), sha256, media_type)


def failed_of(message: Mapping[str, Any]) -> Failed:
    """Return a problem document of a known type; its title and status are the table's, whatever the worker sent."""
    said = mapping(message.get("problem"))
    slug = str(said.get("type", "")).removeprefix("/problems/")
    if not SLUG.fullmatch(slug) or slug not in KINDS:
        raise NotBelieved("unknown problem")
    kind = KINDS[slug]
    extra = {name: value for name, value in said.items() if name not in ("type", "title", "status", "detail", "retryable")}
    detail = clean_text(said.get("detail", kind.title))
    return Failed(
        {
            "type": f"/problems/{slug}",
            "title": kind.title,
            "status": kind.status,
            "detail": detail,
            "retryable": kind.retryable,
            **extra,
        }
    )


MOST_CHECKPOINTS = 64  # waiting for adoption
MOST_ROWS = 2000
MOST_WARNINGS = 10_000  # per chunk; repeated ones count again


class Inbox:
    def __init__(self, now: float, convergence: list[Json]) -> None:
        self.heard_at = now
        self.phase = ""
        self.progress: Json | None = None
        self.effective: Json | None = None
        self.convergence = list(convergence)
        self.warnings: list[Json] = []
        self.preview: Preview | None = None
        self.checkpoints: deque[Checkpoint] = deque()
        self.last: Done | Yielded | Failed | None = None
        self.sampling_since: float | None = None
        self.has_news = False  # not yet in its rows
        self.is_urgent = False  # to be written at once
        self._warned = 0

    def put(self, message: Mapping[str, Any], now: float) -> None:
        """Add a message; raises NotBelieved for one that our worker does not send."""
        self.heard_at = now
        if self.last is not None:
            raise NotBelieved("a message after the last")
        at = message.get("at")
        take = getattr(self, f"_on_{at}", None) if isinstance(at, str) and at.isalpha() else None
        if take is not None:
            take(message, now)

    def _on_phase(self, message: Mapping[str, Any], now: float) -> None:
        self.phase = messages.phase_of(message)
        self.has_news = True
        if self.phase == "sampling" and self.sampling_since is None:
            self.sampling_since = now
            self.is_urgent = True

    def _on_effective(self, message: Mapping[str, Any], now: float) -> None:
        found = messages.mapping(message)
        del found["at"]
        self.effective = found
        self.has_news = True

    def _on_warning(self, message: Mapping[str, Any], now: float) -> None:
        self._warned += 1
        if self._warned > MOST_WARNINGS:
            raise NotBelieved("too many warnings")
        self.warnings.append(messages.warning_of(message))
        self.has_news = True

    def _on_progress(self, message: Mapping[str, Any], now: float) -> None:
        self.progress = messages.progress_of(message)
        self.has_news = True

    def _on_row(self, message: Mapping[str, Any], now: float) -> None:
        """Add a row of the convergence curve. A chunk that resumed from a checkpoint repeats rows that its predecessor measured
        after it."""
        row = messages.row_of(message)
        self.convergence = [earlier for earlier in self.convergence if earlier["samples"] < row["samples"]]
        if len(self.convergence) >= MOST_ROWS:
            raise NotBelieved("too many rows")
        self.convergence.append(row)
        self.has_news = True

    def _on_preview(self, message: Mapping[str, Any], now: float) -> None:
        self.preview = messages.preview_of(message)

    def _on_checkpoint(self, message: Mapping[str, Any], now: float) -> None:
        if len(self.checkpoints) >= MOST_CHECKPOINTS:
            raise NotBelieved("too many checkpoints")
        self.checkpoints.append(messages.checkpoint_of(message))

    def _on_done(self, message: Mapping[str, Any], now: float) -> None:
        self.last = messages.done_of(message)

    def _on_yielded(self, message: Mapping[str, Any], now: float) -> None:
        self.last = Yielded()

    def _on_failed(self, message: Mapping[str, Any], now: float) -> None:
        self.last = messages.failed_of(message)
