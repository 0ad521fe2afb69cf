"""A Ray cluster on loopback for tests, in a process of its own: python -m tests.service.executor.ray.cluster

It prints its address as JSON, does what lines of JSON on stdin ask for, and ends with them. Two nodes of one core each, that
share nothing: each keeps its scenes in a folder of its own.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tests.service.faults import descendants

ROOT = Path(__file__).parents[4]
TOKEN = "of-tests-" + "0" * 55
LOOPBACK = "127.0.0.1"
STARTS = 4
# Ray takes loopback for a node's address only where it believes that there are no clusters, as on macOS.
ENVIRONMENT = {
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": TOKEN,
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_worker_niceness": "0",  # 15 and the workers' own 10 leave a chunk 1.5 % of a core that other tests use too
    "RAY_gcs_rpc_server_reconnect_timeout_s": "3",
    "RAY_TMPDIR": "",  # a folder of its own
    "PYTHONPATH": os.pathsep.join([str(ROOT / "renderer"), str(ROOT / "service"), str(ROOT)]),
}


class RunningCluster:
    """Seen from the tests."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="ray-"))  # a short path: sockets are made in it
        self.environment = {**ENVIRONMENT, "RAY_TMPDIR": str(self.folder)}
        self.log = self.folder / "cluster.log"
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.service.executor.ray.cluster"],
                cwd=ROOT,
                env={**os.environ, **self.environment},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        self.address = str(self._answer()["address"])

    def ask(self, **line: Any) -> dict[str, Any]:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(line) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, f"the cluster did not start:\n{self.log.read_text()[-4000:]}"
        answer: dict[str, Any] = json.loads(line)
        return answer

    def workers(self) -> list[int]:
        """The sandboxed processes themselves, on all nodes: those that run a chunk, and those that wait for one."""
        return [pid for pid in descendants(self._process.pid) if not _words(pid)[0].endswith(b"bwrap")]

    def ray_processes(self) -> list[int]:
        """Of all nodes, but for those of tasks and agents: gcs_server, monitor, dashboard, raylets.

        Agents write a title over their arguments and their environment as they start. The walls of workers that wait for more
        of their scene have that on their command line, on any node, and no environment.
        """
        found = {int(path.name): _words(int(path.name)) for path in Path("/proc").glob("[0-9]*")}
        return sorted(
            pid
            for pid, words in found.items()
            if any(str(self.folder).encode() in word for word in words)
            and not words[0].startswith(b"ray::")
            and not words[0].endswith(b"bwrap")
            and not any(word.endswith((b"/agent.py", b"/agent/main.py")) for word in words)
        )

    def tasks(self) -> list[int]:
        """Ray's processes that have such."""
        found = set()
        for pid in self.workers():
            while pid > 1 and not _words(pid)[0].startswith(b"ray::"):
                pid = _parent(pid)
            found.add(pid)
        return sorted(found - {0, 1})

    def stop(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def _free_port() -> int:
    with socket.socket() as found:
        found.bind((LOOPBACK, 0))
        return int(found.getsockname()[1])


def _words(pid: int) -> list[bytes]:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return [b""]


def _parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[1])
    except OSError:
        return 0


class Nodes:
    """In the cluster's own process."""

    def __init__(self) -> None:
        from ray.cluster_utils import Cluster

        self._messages = os.fdopen(os.dup(1), "w")
        os.dup2(2, 1)
        self._folder = Path(os.environ["RAY_TMPDIR"])
        self._new = Cluster
        self._port = _free_port()
        self._cluster: Any = None
        self._others: dict[int, Any] = {}
        self._again(self.begin)

    def begin(self) -> None:
        """Always at the same address, as a head that comes back; what is left of one before ends."""
        if self._cluster is not None:
            for node in [self._cluster.head_node, *self._others.values()]:
                self._kill(node)
            self._cluster.global_state.disconnect()
        self._cluster = self._new(initialize_head=True, head_node_args={**self._about(0, {}), "gcs_server_port": self._port})
        self._others.clear()
        self.add(1, {}, {})

    def _about(self, number: int, labels: Mapping[str, str], environment: Mapping[str, str] | None = None) -> dict[str, Any]:
        return {
            "num_cpus": 1,
            "memory": 4 * 2**30,
            "object_store_memory": 100 * 2**20,
            "node_ip_address": LOOPBACK,
            "include_dashboard": False,
            "include_log_monitor": False,
            "labels": {"number": str(number), **labels},
            "env_vars": {"PRIMRAY_NODE_DIR": str(self._folder / f"node-{number}"), **(environment or {})},
        }

    def add(self, number: int, labels: Mapping[str, str], environment: Mapping[str, str]) -> None:
        self._others[number] = self._cluster.add_node(**self._about(number, labels, environment))

    def remove(self, number: int) -> None:
        self._cluster.remove_node(self._others.pop(number), allow_graceful=False)

    def kill_head(self) -> None:
        self._kill(self._cluster.head_node)

    def kill_raylet(self, number: int) -> None:
        """As a node that loses its power: what it ran ends with it."""
        self._kill(self._others[number], "raylet")
        self.remove(number)
        self._again(lambda: self.add(number, {}, {}))

    @staticmethod
    def _again(start: Callable[[], None]) -> None:
        """Ray gives a node 30 s to start, which may be too few on a machine that others use too."""
        for left in reversed(range(STARTS)):
            try:
                start()
                return
            except Exception:
                if not left:
                    raise
                traceback.print_exc()

    @staticmethod
    def _kill(node: Any, kind: str | None = None) -> None:
        for name, processes in node.all_processes.items():
            for info in processes if kind in (None, name) else []:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(info.process.pid, signal.SIGKILL)

    def answer(self, **line: Any) -> None:
        self._messages.write(json.dumps(line) + "\n")
        self._messages.flush()

    def live(self) -> None:
        self.answer(address=self._cluster.address)
        for line in sys.stdin:
            asked = json.loads(line)
            began = time.monotonic()
            if asked["do"] == "add":
                self.add(asked["number"], asked.get("labels", {}), asked.get("environment", {}))
            elif asked["do"] == "remove":
                self.remove(asked["number"])
            elif asked["do"] == "kill-head":
                self.kill_head()
            elif asked["do"] == "kill-raylet":
                self.kill_raylet(asked["number"])
            elif asked["do"] == "restart":
                self._again(self.begin)
            self.answer(took_s=time.monotonic() - began)
        self._cluster.shutdown()


if __name__ == "__main__":
    Nodes().live()
