"""Monitoring for the server's operator: its log, Prometheus metrics, and optional OpenTelemetry traces.

The log is a line of JSON for each event, or readable text on a terminal: no keys, no bodies, no query strings. Context that is
bound once is part of every line after: request_id (http/guard.py), job_id, tenant, attempt, frame.

Metrics are this server's requests as they happen, and everything else as it is at the time of the scrape.

Traces of requests are on if the extra `otel` is installed and an exporter is named by OTEL_* in the environment. The W3C
traceparent of the request that submits a job is stored in its row and passed to its workers.
"""

from __future__ import annotations

import itertools
import logging
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, TextIO

import structlog
import structlog.tracebacks
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.exposition import generate_latest
from prometheus_client.process_collector import ProcessCollector

from primray import __version__

from .jobs import JobState

if TYPE_CHECKING:
    from .dispatcher.context import Metrics as DispatcherMetrics
    from .dispatcher.context import Timings
    from .service import Service


# Secrets that must never be logged, however they came into a value: our keys, bearer tokens, webhook secrets, passwords in
# URLs.
SECRETS = re.compile(r"primray_[A-Za-z0-9_-]{20,}|(?i:bearer)\s+\S+|whsec_[A-Za-z0-9+/=]+|(?<=://)[^/\s:@]+:[^/\s@]+(?=@)")
SECRET_NAMES = frozenset({"authorization", "cookie", "set-cookie", "key", "secret", "password", "query", "query_string"})
HIDDEN = "[hidden]"


def configure_log(as_json: bool | None = None, stream: TextIO | None = None, level: int = logging.INFO) -> None:
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
    # A thread that imports the module for the first time has it in the table before it is complete.
    current_span = getattr(sys.modules.get("opentelemetry.trace"), "get_current_span", None)
    if current_span is not None:
        context = current_span().get_span_context()
        if context.is_valid:
            event["trace_id"] = f"{context.trace_id:032x}"
    return event


LATENCY_S = (0.002, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 60.0)


class RequestMetrics:
    """Metrics of requests by the route's template, never by path: ids would make a series each."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        by = ("method", "route", "status")
        self.seconds = Histogram(
            "primray_http_request_seconds", "Time until the answer was sent.", by, buckets=LATENCY_S, registry=self.registry
        )
        self.in_progress = Gauge(
            "primray_http_requests_in_progress",
            "Requests in progress, including event streams.",
            ("method", "route"),
            registry=self.registry,
        )
        self.uploaded_bytes = Counter("primray_uploaded_bytes", "Bytes of request bodies.", registry=self.registry)
        self.sent_bytes = Counter("primray_sent_bytes", "Bytes of answer bodies.", registry=self.registry)
        ProcessCollector(namespace="primray", registry=self.registry)


def exposition(requests: RequestMetrics, service: Service) -> bytes:
    """Return the metrics in the text format. Reads the store: call it in a thread."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Now(service))
    return generate_latest(requests.registry) + generate_latest(registry)


class _Now:
    def __init__(self, service: Service) -> None:
        self._service = service

    def collect(self) -> Iterable[Metric]:
        yield _gauge("primray_info", "Version of this server.", {__version__: 1.0}, "version")
        counts = self._service.store.counts()
        states = {state.value: float(counts.get(state.value, 0)) for state in JobState}
        yield _gauge("primray_jobs", "Jobs by state, of all tenants.", states, "state")
        yield GaugeMetricFamily(
            "primray_disk_free_bytes", "Free bytes of the data directory's disk.", value=self._service.data.free_bytes()
        )
        dispatcher: DispatcherMetrics | None = getattr(self._service.dispatcher, "metrics", None)
        leads = dispatcher is not None and dispatcher.holds_lease
        slots = self._service.executor.capacity().slots if leads else 0
        yield GaugeMetricFamily("primray_executor_slots", "Concurrent renders, on the server that dispatches.", value=slots)
        if dispatcher is not None:
            yield from _of_dispatcher(dispatcher)


def _of_dispatcher(found: DispatcherMetrics) -> Iterable[Metric]:
    yield GaugeMetricFamily("primray_dispatcher_leader", "1: this server holds the lease.", value=float(found.holds_lease))
    yield GaugeMetricFamily("primray_frames_running", "Frames running on this server.", value=found.running)
    yield _counter("primray_frames_started", "Frames given to a worker.", {"": found.frames_started})
    yield _counter("primray_frames_ended", "Frames ended, by state or problem slug.", found.frames_ended, "reason")
    yield _counter("primray_frames_restarted", "Frames queued again, by reason.", found.restarts, "reason")
    yield _counter("primray_checkpoints", "Adopted.", {"": found.checkpoints})
    yield _counter("primray_scene_checks", "Scene checks ended, by result.", found.checks_ended, "result")
    yield _counter("primray_leases", "Number of times this server acquired the lease.", {"": found.leases})
    yield _counter("primray_leases_lost", "Number of times this server lost the lease to another.", {"": found.leases_lost})
    yield _counter("primray_jobs_deleted", "Jobs expired at the end of their time to live.", {"": found.jobs_deleted})
    yield _counter("primray_worker_cpu_seconds", "CPU seconds of render workers that have ended.", {"": found.worker_cpu_s})
    yield _histogram("primray_queue_wait_seconds", "Time from queued to claimed, per frame.", found.queue_wait)
    yield _histogram("primray_first_sample_seconds", "Time from claimed to sampling, per frame.", found.first_sample)
    yield _histogram("primray_checkpoint_seconds", "Time from a checkpoint's message to its row.", found.adopt_checkpoint)
    yield _histogram("primray_frame_end_seconds", "Time from a frame's last message to its row.", found.end_frame)


def _gauge(name: str, says: str, values: Mapping[str, float], label: str) -> GaugeMetricFamily:
    family = GaugeMetricFamily(name, says, labels=(label,))
    for value, number in values.items():
        family.add_metric((value,), number)
    return family


def _counter(name: str, says: str, values: Mapping[str, float], label: str = "") -> CounterMetricFamily:
    family = CounterMetricFamily(name, says, labels=(label,) if label else ())
    for value, number in values.items():
        family.add_metric((value,) if label else (), number)
    return family


def _histogram(name: str, says: str, timings: Timings) -> HistogramMetricFamily:
    bounds = [*(str(bound) for bound in timings.buckets), "+Inf"]
    sums = list(itertools.accumulate(timings.counts))
    return HistogramMetricFamily(name, says, buckets=list(zip(bounds, sums, strict=True)), sum_value=timings.total_s)


Scope = MutableMapping[str, Any]  # of ASGI

ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
UNTRACED = "healthz,readyz,metrics"  # requested every few seconds


def tracing_is_wanted() -> bool:
    if os.environ.get("OTEL_SDK_DISABLED", "").lower() == "true":
        return False
    return any(os.environ.get(name) for name in ENDPOINTS) or os.environ.get("OTEL_TRACES_EXPORTER") == "console"


def instrument(app: Any, path_of: Callable[[Scope], str]) -> str:
    """Trace the requests of a Starlette application, if configured; return a sentence for the log, "" if not.

    `path_of` returns the path of the route that answers a request, with its parameters' names.
    """
    if not tracing_is_wanted():
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
