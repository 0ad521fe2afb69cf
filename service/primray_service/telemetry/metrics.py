"""Prometheus metrics: this server's requests as they happen, everything else as it is at the time of the scrape."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.exposition import generate_latest
from prometheus_client.process_collector import ProcessCollector

from primray import __version__

from ..jobs import JobState

if TYPE_CHECKING:
    from ..dispatcher.metrics import Metrics as DispatcherMetrics
    from ..dispatcher.metrics import Timings
    from ..service import Service

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
