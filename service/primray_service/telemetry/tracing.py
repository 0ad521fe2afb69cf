"""Optional OpenTelemetry: on if the extra `otel` is installed and an exporter is named by OTEL_* in the environment.

Traces requests; the W3C traceparent of the request that submits a job is stored in its row and passed to its workers.
"""

from __future__ import annotations

import os
from collections.abc import Callable, MutableMapping
from typing import Any

Scope = MutableMapping[str, Any]  # of ASGI

ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
UNTRACED = "healthz,readyz,metrics"  # requested every few seconds


def is_wanted() -> bool:
    if os.environ.get("OTEL_SDK_DISABLED", "").lower() == "true":
        return False
    return any(os.environ.get(name) for name in ENDPOINTS) or os.environ.get("OTEL_TRACES_EXPORTER") == "console"


def instrument(app: Any, path_of: Callable[[Scope], str]) -> str:
    """Trace the requests of a Starlette application, if configured; return a sentence for the log, "" if not.

    `path_of` returns the path of the route that answers a request, with its parameters' names.
    """
    if not is_wanted():
        return ""
    try:
        from opentelemetry import trace
        from opentelemetry.instrumentation.asgi import OpenTelemetryMiddleware
        from opentelemetry.sdk.resources import SERVICE_NAME, Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError:
        return "OTEL_* is set, but the extra is not installed: pip install 'primray[server,otel]'"
    provider = TracerProvider(resource=Resource.create({SERVICE_NAME: os.environ.get("OTEL_SERVICE_NAME", "primray")}))
    provider.add_span_processor(BatchSpanProcessor(_exporter()))
    trace.set_tracer_provider(provider)

    def span(scope: Scope) -> tuple[str, dict[str, str]]:
        path = path_of(scope)
        return f"{scope['method']} {path}".rstrip(), {"http.route": path} if path else {}

    app.add_middleware(
        OpenTelemetryMiddleware, excluded_urls=UNTRACED, default_span_details=span, exclude_spans=["receive", "send"]
    )
    return "requests are traced by OpenTelemetry"


def _exporter() -> Any:
    if os.environ.get("OTEL_TRACES_EXPORTER") == "console":
        from opentelemetry.sdk.trace.export import ConsoleSpanExporter

        return ConsoleSpanExporter()
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter

    return OTLPSpanExporter()


def traceparent() -> str:
    """Return the current span in W3C's form (https://www.w3.org/TR/trace-context/); "" if nothing is traced."""
    try:
        from opentelemetry import trace
    except ImportError:
        return ""
    context = trace.get_current_span().get_span_context()
    return f"00-{context.trace_id:032x}-{context.span_id:016x}-{int(context.trace_flags):02x}" if context.is_valid else ""
