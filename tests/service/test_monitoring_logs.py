"""The log, for machines and for people: no secret is in it."""

from __future__ import annotations

import io
import json
import logging
import sys
from types import ModuleType
from typing import Any

import pytest
import structlog

from primray_service import monitoring

SECRETS = {
    "authorization": "Bearer abc.def",
    "detail": "sent primray_" + "Ab1-" * 11 + " and whsec_c2VjcmV0c2VjcmV0c2VjcmV0 to postgresql+psycopg://user:pass@db/x",
    "nested": {"cookie": "primray_session=1", "list": ["bearer xyz", {"key": "k"}]},
}


@pytest.fixture
def _logging_as_it_was() -> Any:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:], root.level = handlers, level
    structlog.reset_defaults()


class Unprintable:
    def __repr__(self) -> str:
        raise RuntimeError("it changes while it is shown")


def _fail(body: str, other: Unprintable) -> None:
    raise ValueError("primray_" + "Ab1-" * 11)


@pytest.mark.usefixtures("_logging_as_it_was")
def test_the_log_is_a_line_of_json_without_secrets() -> None:
    stream = io.StringIO()
    monitoring.configure_log(True, stream)
    structlog.get_logger("x").info("request", **SECRETS, job_id="job_1")
    logging.getLogger("uvicorn.error").warning("from elsewhere: %s", "Bearer abcdef")
    try:
        _fail("the body of a request", Unprintable())
    except ValueError:
        structlog.get_logger("x").exception("failed")
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["event"] for line in lines] == ["request", "from elsewhere: [hidden]", "failed"]
    assert lines[0]["job_id"] == "job_1"
    assert lines[0]["detail"] == "sent [hidden] and [hidden] to postgresql+psycopg://[hidden]@db/x"
    assert lines[0]["nested"] == {"cookie": "[hidden]", "list": ["[hidden]", {"key": "[hidden]"}]}
    assert lines[2]["exception"][0]["exc_type"] == "ValueError"
    for secret in ("the body of a request", "abc.def", "Ab1-", "whsec_", "user:pass", "xyz", "session=1"):
        assert secret not in stream.getvalue()


@pytest.mark.usefixtures("_logging_as_it_was")
def test_the_log_for_people_is_readable() -> None:
    stream = io.StringIO()
    monitoring.configure_log(False, stream)
    structlog.get_logger("x").info("request", path="/v1/jobs", key="secret")
    assert "request" in stream.getvalue()
    assert "path=/v1/jobs" in stream.getvalue()
    assert "secret" not in stream.getvalue()


def test_a_line_is_written_while_another_thread_imports_the_tracing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The module is in Python's table then, and empty."""
    monkeypatch.setitem(sys.modules, "opentelemetry.trace", ModuleType("opentelemetry.trace"))
    assert monitoring._with_trace(None, "info", {"event": "request"}) == {"event": "request"}
