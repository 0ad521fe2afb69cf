"""The process that workers are forked from. It has done a worker's imports, knows nothing of any job, and starts no thread.

python -m primray_service.worker.fork_server HANDLE      (executor/fork_server.py starts it; HANDLE is a socket)

Each request on the socket (a JSON object, and four files: a worker's stdin, stdout and stderr, and a control socket) becomes
two processes:

- The keeper, which is this process forked, has bubblewrap make the worker's root and namespaces, joins them, and forks. It is
  outside of the sandbox, tells the server the worker's process id and its end, and kills it when the server asks for that or is
  gone. It runs no code but this.
- The worker, which enters the sandbox as one that was started as a program does, and serves.

The keeper reads the request, not this process: what is of one job is never in memory that another is forked from. All workers
have the memory layout and the hash seed of this process, so the server replaces it after some of them.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import random
import select
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..sandbox.attempts import attempt_all
from ..sandbox.entry import close_other_files, drop_capabilities, enter, no_new_privileges
from ..sandbox.namespaces import join
from .channel import claim_stdout
from .serving import AUTOGROUP_EVERY_S, NICE, SessionPriority, open_channel, serve

READY = b'{"at": "ready"}\n'
REQUEST_BYTES = 2**17
FILES = 4
MOST_LOST = 3  # forks in a row that ended without reading their request
# It has of each kind of prim one, so that USD's tables of schemas are filled.
STAGE = """#usda 1.0
def Camera "camera" {
}
def Sphere "ball" {
    double3 xformOp:translate = (0, 0, -5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "triangle" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    rel material:binding = </surface>
}
def Material "surface" {
    token outputs:surface.connect = </surface/shader.outputs:surface>
    def Shader "shader" {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
def DistantLight "sun" {
}
"""
# What checks and renders import besides, when they first need it.
LATER_IMPORTS = """encodings.ascii numpy.ma OpenImageIO PyOpenColorIO primray.render.progress primray.report.picture_checks
    primray.report.rare_paths primray.report.vague_error primray.textures.coverage primray.usd.incremental
    primray_service.worker.check primray_service.worker.failures primray_service.worker.merge_task
    primray_service.worker.product_task primray_service.worker.render_task"""

Work = Callable[["Request"], None]


def main(arguments: list[str]) -> None:
    (handle,) = arguments
    close_other_files((int(handle),))
    preload(Path("warm.usda"))
    os.chdir("/")
    gc.collect()
    gc.freeze()
    os.write(1, READY)
    accept(socket.socket(fileno=int(handle)), run)
    os._exit(0)


def preload(stage: Path) -> None:
    """Do what each process does once, as far as that starts no thread: imports, USD's plug-ins, OpenColorIO's configuration."""
    from primray import core, usd
    from primray.composition import Composition
    from primray.diagnostics import Diagnostics
    from primray.errors import SettingsError
    from primray.images.exposure import View
    from primray.report.report import package_versions
    from primray.settings import RenderSettings

    for name in LATER_IMPORTS.split():
        importlib.import_module(name)
    core.build_digest()
    package_versions()
    usd.limit_threads(1)
    stage.write_text(STAGE)
    usd.translate(usd.open_stage(str(stage), Diagnostics(), Composition()), RenderSettings())
    stage.unlink()
    with contextlib.suppress(SettingsError):  # jobs that need the view report it
        View().check()


def accept(requests: socket.socket, work: Work) -> None:
    """Fork for each request until the server is gone, then wait for the keepers that are left."""
    keepers: dict[int, int] = {}  # by pidfd
    poll = select.poll()
    poll.register(requests, select.POLLIN)
    is_open, lost = True, 0
    while is_open or keepers:
        for handle, _ in poll.poll():
            if handle in keepers:
                poll.unregister(handle)
                os.waitpid(keepers.pop(handle), 0)
                os.close(handle)
            elif not is_requested(requests):
                poll.unregister(requests)
                is_open = False
            else:
                keeper, was_read = fork_for_request(requests, work)
                lost = 0 if was_read else lost + 1
                if lost > MOST_LOST:
                    raise SystemExit("no process can be forked")
                pidfd = os.pidfd_open(keeper)
                keepers[pidfd] = keeper
                poll.register(pidfd, select.POLLIN)


def is_requested(requests: socket.socket) -> bool:
    """Return whether there is a request, without reading it; False: the server is gone."""
    try:
        return requests.recv(1, socket.MSG_PEEK) != b""
    except ConnectionError:
        return False


def fork_for_request(requests: socket.socket, work: Work) -> tuple[int, bool]:
    """Return the new process, and whether it has read the request."""
    threads = len(os.listdir("/proc/self/task"))
    if threads != 1:
        raise SystemExit(f"{threads} threads run: a fork would leave them behind")
    wait, tell = os.pipe()
    keeper = os.fork()
    if keeper == 0:
        status = 1
        try:
            os.close(wait)
            status = keep(requests, tell, work)
        except BaseException:
            sys.excepthook(*sys.exc_info())
        finally:
            os._exit(status)
    os.close(tell)
    was_read = os.read(wait, 1) != b""
    os.close(wait)
    return keeper, was_read


@dataclass(frozen=True)
class Request:
    kind: str  # "render", "check", or "attempts": the sandbox's self-test
    plan: Mapping[str, Any]  # of the sandbox
    environment: Mapping[str, str]
    threads: int
    bubblewrap: list[str] | None  # the argument list that makes its root; None: it has the machine's
    targets: Mapping[str, Any]  # of the self-test

    def complete_plan(self) -> dict[str, Any]:
        """Return the sandbox's plan with what only the worker knows."""
        return {**self.plan, "parent": None if self.bubblewrap is not None else os.getppid()}


def keep(requests: socket.socket, tell: int, work: Work) -> int:
    """The keeper's life; returns its exit code."""
    data, files, _, _ = socket.recv_fds(requests, REQUEST_BYTES, FILES)
    os.write(tell, b"1")
    os.close(tell)
    requests.detach()
    close_other_files(tuple(files))
    os.setsid()
    request = Request(**json.loads(data))
    stdin, stdout, stderr, control = files
    os.dup2(stderr, 2)  # its own messages are part of the worker's log
    session = SessionPriority(NICE.get(request.kind, 0))
    session.lower()
    parked = None if request.bubblewrap is None else park(request.bubblewrap)
    worker = os.fork()
    if worker == 0:
        status = 1
        try:
            become_worker(request, (stdin, stdout, stderr))
            work(request)
            status = 0
        except BaseException:
            sys.excepthook(*sys.exc_info())
        finally:
            os._exit(status)
    for handle in (stdin, stdout, stderr):
        os.close(handle)
    with socket.socket(fileno=control) as server:
        server.send(json.dumps({"pid": worker}).encode())
        wait_for_end(worker, server, session)
        _, status, usage = os.wait4(worker, 0)
        used = {"cpu_s": usage.ru_utime + usage.ru_stime, "max_rss_bytes": usage.ru_maxrss * 1024}
        with contextlib.suppress(OSError):  # nobody wants to know
            server.send(json.dumps({"status": status, **used}).encode())
    if parked is not None:
        parked.kill()
        parked.wait()
    return 0


def park(arguments: list[str]) -> subprocess.Popen[bytes]:
    """Have bubblewrap make a root around a program that waits, and join its namespaces."""
    read, write = os.pipe()
    parked = subprocess.Popen(
        [arguments[0], "--info-fd", str(write), *arguments[1:]],
        env={},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=(write,),
        bufsize=0,
    )
    os.close(write)
    assert parked.stdin is not None
    assert parked.stdout is not None
    with open(read, "rb") as info:
        said = info.read()
    parked.stdin.write(b"\n")
    if parked.stdout.read(1) != b"\n":
        raise SystemExit(f"bubblewrap ended with {parked.wait()}")
    join(int(json.loads(said)["child-pid"]))
    return parked


def become_worker(request: Request, files: tuple[int, int, int]) -> None:
    """Be what a worker is that was started as a program, before it enters the sandbox: of this process nothing stays open, no
    random numbers are shared, and it ends with the keeper."""
    for standard, handle in enumerate(files):
        os.dup2(handle, standard)
    close_other_files()
    if request.bubblewrap is not None:  # which would have dropped those that come with a user namespace
        drop_capabilities()
        no_new_privileges()
    os.environ.clear()
    os.environ.update(request.environment)
    tempfile.tempdir = None
    if "numpy.random" in sys.modules:
        sys.modules["numpy.random"].seed()


def wait_for_end(worker: int, server: socket.socket, session: SessionPriority) -> None:
    """Return when the worker has ended; kill it when the server asks for that, or is gone."""
    pidfd = os.pidfd_open(worker)
    poll = select.poll()
    poll.register(pidfd, select.POLLIN)
    poll.register(server, select.POLLIN)
    while True:
        found = dict(poll.poll(None if session.is_low else 1000 * AUTOGROUP_EVERY_S * random.random()))
        if pidfd in found:
            return
        if server.fileno() in found:
            signal.pidfd_send_signal(pidfd, signal.SIGKILL)
            poll.unregister(server)
        session.lower()


def run(request: Request) -> None:
    """The worker's life."""
    from primray import usd

    messages = claim_stdout()
    os.nice(NICE.get(request.kind, 0))
    entered = enter((messages.fileno(),), request.complete_plan())
    if request.kind == "attempts":
        os.dup2(messages.fileno(), 1)
        attempt_all(entered, dict(request.targets))
        return
    channel = open_channel(entered, messages)
    usd.limit_threads(request.threads)
    serve(request.kind, entered, channel)


if __name__ == "__main__":
    main(sys.argv[1:])
