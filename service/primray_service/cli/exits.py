"""Exit codes of these commands: those of `primray` (primray/cli/__init__.py), by the error or by how a job ended."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from primray.errors import PrimrayError

from ..problems import Problem

if TYPE_CHECKING:
    from ..client import Job

FAILED, USAGE, SCENE_REJECTED, LIMIT, TARGET_MISSED, INTERRUPTED = 1, 2, 3, 4, 5, 130

_EXITS = {
    slug: exit_code
    for exit_code, slugs in (
        (
            SCENE_REJECTED,
            "not-usd ambiguous-entry entry-missing package-unsafe package-too-large asset-path-outside-job asset-missing "
            "layer-unreadable scene-rejected strict-warnings",
        ),
        (
            USAGE,
            "invalid-request invalid-json settings-rejected unsupported-media-type unsupported-setting view-unavailable "
            "webhook-address parallel-adaptive parallel-denoise idempotency-key-reused",
        ),
        (
            LIMIT,
            "limit-exceeded upload-too-large request-too-large quota-exceeded too-many-requests scene-too-large time-limit "
            "memory-limit storage-limit job-expired storage-full",
        ),
    )
    for slug in slugs.split()
}

# Members of a problem document that locate the problem.
_PLACES = ("member", "layer", "line", "column", "prim", "asset_path", "entry", "limit", "count", "signal")


class CommandError(PrimrayError):
    def __init__(self, code: str, message: str, exit_code: int = FAILED, *, where: str = "") -> None:
        super().__init__(message, where=where, code=code)
        self.exit_code = exit_code


def error_of(document: Mapping[str, Any], advice: str = "") -> CommandError:
    """Return a problem document as the error that the command ends with."""
    slug = str(document.get("type", "")).removeprefix("/problems/") or "error"
    message = str(document.get("detail") or document.get("title") or "")
    candidates = document.get("candidates")
    if isinstance(candidates, list):
        message += f" ({', '.join(map(str, candidates))}: choose by --entry)"
    places = [f"{name.replace('_', ' ')} {document[name]}" for name in _PLACES if document.get(name) not in (None, "")]
    code = str(document.get("code") or slug)  # the renderer's own code if the error is the renderer's, as in `primray render`
    return CommandError(code, f"{message}{advice}", _EXITS.get(slug, FAILED), where=", ".join(places))


@contextmanager
def problems_as_errors() -> Iterator[None]:
    """Convert problems raised in this process, rather than by a server, into the command's errors."""
    try:
        yield
    except Problem as problem:
        raise error_of(problem.as_json()) from None


def error_of_end(job: Job) -> CommandError | None:
    """Return the error for a job that has ended, or None if it did what was requested."""
    if job.state == "succeeded":
        missed = missed_target(job)
        return None if missed is None else CommandError("target-missed", missed, TARGET_MISSED)
    if job.error is not None:
        return error_of(job.error)
    exit_code = LIMIT if job.state == "expired" else FAILED
    return CommandError(f"job-{job.state}", f"{job.id} is {job.state}", exit_code)


def missed_target(job: Job) -> str | None:
    target = (job.settings.get("stop") or {}).get("target_error")
    error = job.progress.error
    if target is None or error is None or error.estimate is None or error.estimate <= target:
        return None
    return f"the error is {error.estimate:.4g}, above the target {target:.4g}"
