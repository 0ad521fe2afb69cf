"""The server's log: a line of JSON for each event, or readable text on a terminal. No keys, no bodies, no query strings.

Context that is bound once and then part of every line: request_id (http/guard.py), job_id, tenant, attempt, frame.
"""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Mapping, MutableMapping
from typing import Any, TextIO

import structlog
import structlog.tracebacks

# Secrets that must never be logged, however they came into a value: our keys, bearer tokens, webhook secrets, passwords in
# URLs.
SECRETS = re.compile(r"primray_[A-Za-z0-9_-]{20,}|(?i:bearer)\s+\S+|whsec_[A-Za-z0-9+/=]+|(?<=://)[^/\s:@]+:[^/\s@]+(?=@)")
SECRET_NAMES = frozenset({"authorization", "cookie", "set-cookie", "key", "secret", "password", "query", "query_string"})
HIDDEN = "[hidden]"


def configure(as_json: bool | None = None, stream: TextIO | None = None, level: int = logging.INFO) -> None:
    """Configure logging once, at a process's start. `as_json` None: unless the stream is a terminal."""
    stream = stream or sys.stderr
    as_json = not stream.isatty() if as_json is None else as_json
    shared: list[Any] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        _with_trace,
    ]
    if as_json:
        last: list[Any] = [
            # Without the frames' variables: they hold bodies, and their repr may raise.
            structlog.processors.ExceptionRenderer(structlog.tracebacks.ExceptionDictTransformer(show_locals=False)),
            without_secrets,
            structlog.processors.JSONRenderer(ensure_ascii=False),
        ]
    else:
        last = [structlog.processors.format_exc_info, without_secrets, structlog.dev.ConsoleRenderer(colors=stream.isatty())]
    structlog.configure(
        processors=[*shared, *last],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.WriteLoggerFactory(stream),
        cache_logger_on_first_use=False,
    )
    _take_over_standard_logging(shared, last, stream, level)


def _take_over_standard_logging(shared: list[Any], last: list[Any], stream: TextIO, level: int) -> None:
    """Route standard logging (uvicorn, alembic) through the same processors."""
    handler = logging.StreamHandler(stream)
    # The traceback is in the record here; the formatter's own step puts it into the event.
    steps = [structlog.stdlib.ProcessorFormatter.remove_processors_meta, *last]
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[*shared, structlog.stdlib.ExtraAdder(), structlog.stdlib.add_logger_name], processors=steps
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(max(level, logging.WARNING))
    for name in ("uvicorn", "uvicorn.error", "uvicorn.access", "alembic"):
        logger = logging.getLogger(name)
        logger.handlers.clear()
        logger.propagate = True


def without_secrets(_: Any, __: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
    """Redact members with secret names, and whatever looks like a secret, at any depth."""
    return {name: HIDDEN if name.lower() in SECRET_NAMES else _hidden(value) for name, value in event.items()}


def _hidden(value: Any) -> Any:
    if isinstance(value, str):
        return SECRETS.sub(HIDDEN, value)
    if isinstance(value, Mapping):
        return {name: HIDDEN if str(name).lower() in SECRET_NAMES else _hidden(member) for name, member in value.items()}
    if isinstance(value, list | tuple):
        return [_hidden(member) for member in value]
    return value


def _with_trace(_: Any, __: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Add the trace's id if OpenTelemetry is on."""
    trace = sys.modules.get("opentelemetry.trace")
    if trace is not None:
        context = trace.get_current_span().get_span_context()
        if context.is_valid:
            event["trace_id"] = f"{context.trace_id:032x}"
    return event
