"""Tracing is off unless the environment asks for it."""

from __future__ import annotations

import pytest
from starlette.applications import Starlette

from primray_service import monitoring


def test_nothing_is_traced_unless_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_TRACES_EXPORTER"):
        monkeypatch.delenv(name, raising=False)
    assert monitoring.instrument(Starlette(), lambda scope: "") == ""
    monkeypatch.setenv("OTEL_TRACES_EXPORTER", "console")
    assert monitoring.tracing_is_wanted()
    monkeypatch.setenv("OTEL_SDK_DISABLED", "true")
    assert not monitoring.tracing_is_wanted()
