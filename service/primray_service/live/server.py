"""The running server of `primray view`: until Ctrl-C or SIGTERM, on loopback only."""

from __future__ import annotations

import asyncio
import contextlib
import os
import secrets
import signal
import socket
import sys
import webbrowser
from collections.abc import Callable, Iterator

import uvicorn

from primray.live.viewed_scene import ViewedScene
from primray.live.viewer import Looks, Viewer

from ..problems import Problem
from .app import News, create_app

ADDRESS = "127.0.0.1"
SHUTDOWN_S = 2
TOKEN_BYTES = 18


def serve(scene: ViewedScene, spp: int, looks: Looks, name: str, port: int, opens: bool) -> None:
    """Print the address, open it in the user's browser if requested, and serve; Problem("unavailable") if the port is not
    available."""
    try:
        listener = socket.create_server((ADDRESS, port))
    except OSError as error:
        raise Problem("unavailable", f"Cannot listen on {ADDRESS} port {port}: {error}.") from None
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    asyncio.run(_run(scene, spp, looks, name, listener, opens))


async def _run(scene: ViewedScene, spp: int, looks: Looks, name: str, listener: socket.socket, opens: bool) -> None:
    news, token = News(), secrets.token_urlsafe(TOKEN_BYTES)
    viewer = Viewer(scene, spp, looks, news.changed)
    url = f"http://{ADDRESS}:{listener.getsockname()[1]}/{token}/"
    config = uvicorn.Config(
        create_app(viewer, news, token, name),
        ws="none",
        lifespan="off",
        access_log=False,
        log_config=None,
        server_header=False,
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    viewer.start()
    try:
        await _Server(config, news.close, lambda: _tell(url, opens)).serve([listener])
    finally:
        await asyncio.to_thread(viewer.close)


def _tell(url: str, opens: bool) -> None:
    print(f"primray shows the stage at {url}", flush=True)
    if opens and not (_has_desktop() and webbrowser.open(url)):
        print("no browser could be started: open this address in one", file=sys.stderr, flush=True)


def _has_desktop() -> bool:
    """Return whether there is a desktop. Without one, Python's default browser may be a program that takes over the
    terminal."""
    return sys.platform == "darwin" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


class _Server(uvicorn.Server):
    """Reports when it listens and when it is to stop; a second Ctrl-C ends it at once."""

    def __init__(self, config: uvicorn.Config, stopping: Callable[[], None], listening: Callable[[], None]) -> None:
        super().__init__(config)
        self._stopping = stopping
        self._listening = listening

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._listening()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        loop = asyncio.get_running_loop()
        numbers = (signal.SIGINT, signal.SIGTERM)
        for number in numbers:
            loop.add_signal_handler(number, self._request_stop)
        try:
            yield
        finally:
            for number in numbers:
                loop.remove_signal_handler(number)

    def _request_stop(self) -> None:
        self.force_exit = self.should_exit
        self.should_exit = True
        self._stopping()
