"""The running server: creates the parts, listens, and stops the parts in reverse order.

It is one process. SIGTERM or Ctrl-C: no new connections, open streams end, running frames write a checkpoint and are queued
again; all within a few seconds. A second signal ends it at once.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import resource
import signal
import socket
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import h11
import structlog
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from . import monitoring
from .app import create_app
from .changes import LOOK_EVERY_S, Changes, SharedReads
from .config import ServeConfig
from .dispatcher import Dispatcher
from .executor.base import executor_maker
from .executor.local import LocalExecutor
from .executor.spot_checks import CheckedExecutor
from .explanations import Explanations
from .files import DataDirectory
from .http.answers import json_bytes
from .limits import Limits
from .objects import opened
from .problems import Problem
from .sandbox import SelfTest, self_test
from .scenes import shared
from .scenes.keep import sweep
from .service import Service
from .store import open_store
from .webhooks import WebhookSender

log = structlog.get_logger("primray.server")

SHUTDOWN_S = 5
HEADER_BYTES = 32 * 1024
FIRST_HEADER_S = 30.0  # a connection that has not sent a request's head by then is closed
KEEP_ALIVE_S = 75
SHARED_READ_S = 1.0
LOOK_ALONE_EVERY_S = 3.0
SWITCH_INTERVAL_S = 0.001


def serve(config: ServeConfig) -> None:
    """Run the server until SIGTERM or Ctrl-C."""
    monitoring.configure_log(config.log_json)
    listener = listen(config)
    allow_many_connections()
    asyncio.run(run(config, listener))


def listen(config: ServeConfig) -> socket.socket:
    """Return a listening socket; Problem("unavailable") if the port is not available."""
    family = socket.AF_INET6 if ":" in config.host else socket.AF_INET
    try:
        listener = socket.create_server((config.host, config.port), family=family, backlog=2048)
    except (OSError, OverflowError) as error:
        raise Problem("unavailable", f"Cannot listen on {config.host} port {config.port}: {error}.") from None
    # Connections inherit this option. asyncio sets it only if a socket names its protocol, and this one does not: without it an
    # answer of two writes waits 40 ms for the acknowledgement of the first.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener


def allow_many_connections() -> None:
    """Raise the limit of open files as far as this process may: each connection is one."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def answer_evenly() -> None:
    """Reduce tail latency: a full garbage collection visits everything that was imported (some 50 ms), and a computing thread
    keeps the event loop waiting for a whole switch interval whenever the two alternate."""
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_INTERVAL_S)


async def run(config: ServeConfig, listener: socket.socket) -> None:
    async with running(config) as service:
        options = uvicorn.Config(
            create_app(service),
            http=Connection,
            ws="none",
            lifespan="off",
            access_log=False,
            log_config=None,
            server_header=False,
            h11_max_incomplete_event_size=HEADER_BYTES,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=SHUTDOWN_S,
        )
        await Server(options, service, url_of(config, listener)).serve([listener])


def url_of(config: ServeConfig, listener: socket.socket) -> str:
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(config.host, config.host)
    return f"http://{f'[{host}]' if ':' in host else host}:{listener.getsockname()[1]}"


@asynccontextmanager
async def running(config: ServeConfig) -> AsyncIterator[Service]:
    """Provide the parts of a server, started; they are stopped afterwards."""
    objects = None if config.objects is None else await asyncio.to_thread(opened, config.objects)
    data = DataDirectory(config.data, objects, config.shared_roots)
    data.create()
    store = await asyncio.to_thread(open_store, config.database_url)
    await asyncio.to_thread(store.migrate)
    await asyncio.to_thread(sweep, store, data)
    # Another server's changes are noticed a moment later, so reads are shared among callers only if there is no other server.
    is_alone = config.database_url.startswith("sqlite")
    changes = Changes(LOOK_ALONE_EVERY_S if is_alone else LOOK_EVERY_S)
    reads = SharedReads(SHARED_READ_S if is_alone else 0.0)
    # The order matters: those who are woken by a change read it.
    unsubscribe = [store.subscribe(reads.changed), store.subscribe(changes.changed)]
    executor = executor_maker(config.executor)(config, data)
    if config.ray_check_tiles is not None:
        inside = LocalExecutor(data, config.limits, cores=config.usable_cores, warm=config.warm)
        executor = CheckedExecutor(executor, inside, data, tiles=config.ray_check_tiles)
    service = Service(config=config, store=store, data=data, executor=executor, dispatcher=None, changes=changes, reads=reads)  # type: ignore[arg-type]
    service.dispatcher = Dispatcher(store, executor, data, config.limits, service.tenant_quotas.of)
    store.listen(service.dispatcher.on_notice)
    dispatching: asyncio.Task[None] | None = None
    sender = WebhookSender(store, config)
    sending: asyncio.Task[None] | None = None
    evicting = asyncio.create_task(keep_evicting(data, config.limits)) if data.objects is not None else None
    try:
        if config.dispatch:
            service.self_test = await asyncio.to_thread(check_sandbox, config, data)
            await executor.start()
            service.explanations = Explanations(config, data, store)
            dispatching = asyncio.create_task(service.dispatcher.run())
            sending = asyncio.create_task(sender.run(lambda: service.dispatcher.fence))
        if config.warm:
            await service.pictures.warm()
        yield service
    finally:
        changes.close()
        if evicting is not None:
            evicting.cancel()
        if sending is not None:
            await sender.stop()
            await sending
        if dispatching is not None:
            await service.dispatcher.stop()
            with contextlib.suppress(asyncio.CancelledError):
                await dispatching
        await executor.close()
        if service.explanations is not None:
            await service.explanations.close()
        await service.pictures.close()
        for end in unsubscribe:
            end()
        store.close()


async def keep_evicting(data: DataDirectory, limits: Limits) -> None:
    """Evict local copies periodically, until cancelled."""
    while True:
        try:
            await asyncio.to_thread(shared.evict, data, 2 * limits.free_disk_bytes)
        except OSError as error:
            log.warning("local copies cannot be removed", error=str(error))
        await asyncio.sleep(shared.EVERY_S)


def check_sandbox(config: ServeConfig, data: DataDirectory) -> SelfTest:
    """Return the result of the sandbox's self-test; Problem("unavailable") if it is too weak for a server that others can
    reach."""
    found = self_test(data.slots)
    if not found.ok and not config.allow_unsandboxed:
        log.warning("the sandbox does not work", **found.as_json())
        if not config.on_loopback:
            raise Problem(
                "unavailable",
                f"The sandbox does not work here: {found.problem}. Untrusted scenes would be opened without isolation: "
                "listen on 127.0.0.1 only, or start with --allow-unsandboxed.",
            )
    return found


class Server(uvicorn.Server):
    """Reports where it listens, and notifies open streams and the dispatcher at once when it is to stop."""

    def __init__(self, config: uvicorn.Config, service: Service, url: str) -> None:
        super().__init__(config)
        self._service = service
        self._url = url

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        answer_evenly()
        print(f"primray listens at {self._url}", flush=True)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._service.changes.close()
        await super().shutdown(sockets)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Handle signals without uvicorn, which would raise the signal again afterwards, before the parts are stopped."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self._request_stop)
        try:
            yield
        finally:
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)

    def _request_stop(self) -> None:
        self.force_exit = self.should_exit  # on the second signal
        self.should_exit = True


class Connection(H11Protocol):
    """uvicorn's connection, but it is closed if no request comes, and malformed requests get a problem document."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.timeout_keep_alive_task = self.loop.call_later(FIRST_HEADER_S, self._close_silent)

    def _close_silent(self) -> None:
        if self.conn.their_state is h11.IDLE and not self.transport.is_closing():
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        super()._unset_keepalive_if_required()

    def _unset_keepalive_if_required(self) -> None:
        """Keep the timeout until a request's head is complete, so that one that trickles in does not extend it."""
        if self.conn.their_state is not h11.IDLE:
            super()._unset_keepalive_if_required()

    def send_400_response(self, msg: str) -> None:
        problem = Problem("invalid-request", "This is not a valid HTTP request.", status=400)
        body = json_bytes(problem.as_json())
        headers = [
            (b"content-type", b"application/problem+json"),
            (b"content-length", str(len(body)).encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"connection", b"close"),
        ]
        for event in (
            h11.Response(status_code=400, headers=headers, reason=b"Bad Request"),
            h11.Data(data=body),
            h11.EndOfMessage(),
        ):
            self.transport.write(self.conn.send(event) or b"")
        self.transport.close()
