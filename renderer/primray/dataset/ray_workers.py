"""Samples on the nodes of a Ray cluster: an actor for each worker, whose scene stays ready from one sample to the next.

Nodes find the config's files and the data set's folder at the same paths as the caller, on a file system that they share, and
have the same primray. Nothing but orders, indices and answers goes through Ray: who renders a sample puts it into place.
"""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from ..errors import PrimrayError, SettingsError
from ..version import __version__
from .worker import Worker, error_of
from .workers import Done

if TYPE_CHECKING:
    from types import ModuleType

LOST = 5  # times that the worker of one sample may be lost, with its node or by itself
NODE = "dataset-node"
LISTENER_S = 5.0


class RayWorkers:
    """Makes samples on a cluster. `address`: of its head, HOST:PORT, or "auto" on one of its nodes.

    `workers`: at most so many at a time; None: as many as there are cores. `cores`: of each worker, which renders with as many
    threads unless the order says how many. A worker that is lost is replaced, and its sample made again. SettingsError if there
    is no such cluster (ray-unreachable) or no Ray (ray-missing).
    """

    def __init__(self, address: str = "auto", *, workers: int | None = None, cores: int = 1) -> None:
        for name, count in (("workers", workers), ("cores", cores)):
            if count is not None and count < 1:
                raise SettingsError(f"the number of {name} must be 1 or more, not {count}", where=name, code="parts-setting")
        self._address, self._workers, self._cores = address, workers, cores

    def run(self, order: Mapping[str, Any], samples: Sequence[int], done: Done) -> None:
        if not samples:
            return
        with _connected(self._address) as ray:
            actor = ray.remote(num_cpus=self._cores, max_restarts=0, max_task_retries=0)(RayWorker)
            given = {**order, "threads": order["threads"] or self._cores}

            def new() -> Any:
                return actor.remote(given, _identity())

            most = self._workers or max(int(ray.cluster_resources().get("CPU", 1)) // self._cores, 1)
            _run(ray, new, min(most, len(samples)), samples, done)


def _run(ray: ModuleType, new: Any, count: int, samples: Sequence[int], done: Done) -> None:
    """Give each worker one sample after the other, and its sample to another one where it is lost."""
    left, losses = deque(samples), dict[int, int]()
    at: dict[Any, tuple[Any, int]] = {}  # worker and sample of each answer that is awaited

    def give(worker: Any) -> None:
        if left:
            index = left.popleft()
            at[worker.make.remote(index)] = worker, index

    try:
        for _ in range(count):
            give(new())
        while at:
            (ready, *_), _ = ray.wait(list(at))
            worker, index = at.pop(ready)
            try:
                answer = ray.get(ready)
            except ray.exceptions.RayError as error:
                losses[index] = losses.get(index, 0) + 1
                if losses[index] >= LOST:
                    raise PrimrayError(
                        f"the worker that makes it was lost {LOST} times: {_first_line(error)}",
                        where=f"sample {index}",
                        code="dataset-worker",
                    ) from None
                left.appendleft(index)
                give(new())
                continue
            if "error" in answer:
                raise error_of(answer)
            done(answer)
            give(worker)
    finally:
        for worker, _ in at.values():
            with suppress(ray.exceptions.RayError):
                ray.kill(worker)


class RayWorker:
    """A worker on a node. `identity`: of the caller's primray, which the node's must equal for the bits to be the same."""

    def __init__(self, order: Mapping[str, Any], identity: Sequence[str]) -> None:
        self._order, self._identity = order, list(identity)
        self._worker: Worker | None = None

    def make(self, index: int) -> dict[str, Any]:
        """Make a sample; return what `Worker.make` does."""
        own = _identity()
        if own != self._identity:
            said = f"a node has primray {' with core '.join(own)}, and the caller {' with core '.join(self._identity)}"
            return _refusal(index, SettingsError(f"{said}: install the same, and set PRIMRAY_ISA on all", code=NODE))
        if self._worker is None:
            try:
                self._worker = Worker(self._order)
            except PrimrayError as error:
                return _refusal(index, error)
        return self._worker.make(index)


def _refusal(index: int, error: PrimrayError) -> dict[str, Any]:
    return {"index": index, "error": [error.exit_code, error.code, error.message, error.where]}


def _identity() -> list[str]:
    """Return what pixels depend on beside the order: version and ISA class."""
    from .sampler import isa_class

    return [__version__, isa_class()]


@contextmanager
def _connected(address: str) -> Iterator[ModuleType]:
    """Yield Ray, connected to a cluster; a connection that the caller has made is used, and stays."""
    try:
        import ray
    except ImportError:
        raise SettingsError("samples on a cluster need Ray: pip install 'primray[ray]'", code="ray-missing") from None
    if ray.is_initialized():
        yield ray
        return
    try:
        if address != "auto":
            _require_listener(address)
        ray.init(address, log_to_driver=False, configure_logging=False, namespace="primray")
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        said = f"no Ray cluster at {address}: {_first_line(error)}"
        raise SettingsError(said, where="--ray", code="ray-unreachable") from error
    try:
        yield ray
    finally:
        ray.shutdown()


def _require_listener(address: str) -> None:
    """Raise OSError or ValueError where nothing listens: Ray's client would end the process."""
    host, _, port = address.rpartition(":")
    if address.startswith("ray://") or not host or not port.isdigit():
        raise ValueError("write HOST:PORT, or auto on one of its nodes")
    socket.create_connection((host, int(port)), LISTENER_S).close()


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
