"""A program that enters the sandbox and tries what a hostile scene might make a worker do; prints a line of JSON for each
attempt.

Every attempt must fail. self_test.py starts it with targets that really exist: a listening port, a readable file.
"""

from __future__ import annotations

import ctypes
import errno
import json
import os
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .entry import Entered, enter

_libc = ctypes.CDLL(None, use_errno=True)
_PTRACE_SEIZE = 0x4206
_CLONE_NEWUSER = 0x10000000
_HELD: list[Any] = []  # keeps opened objects alive during later attempts


def tries(targets: dict[str, Any], job: Path, out: Path) -> dict[str, Callable[[], object]]:
    """Return the attempts by name: calls that raise OSError if refused. The one that would end this program comes last."""
    server = int(targets["server_pid"])
    return {
        "read /etc/passwd": lambda: _read("/etc/passwd"),
        "read a file outside": lambda: _read(targets["file"]),
        "list the data directory": lambda: os.listdir(targets["folder"]),
        "write beside the output folder": lambda: _write(Path(targets["folder"]) / "written"),
        "write to /tmp": lambda: _write(Path("/tmp") / f"primray-attempt-{server}"),
        "write to the job folder": lambda: _write(job / "written"),
        "change the mode of a scene's file": lambda: os.chmod(job / "scene", 0o777),
        "open a scene's file to write": lambda: os.close(os.open(job / "scene", os.O_WRONLY)),
        "link a scene's file into the output folder": lambda: os.link(job / "scene", out / "linked"),
        "make a symbolic link": lambda: os.symlink("/etc", out / "symlink"),
        "read the environment of process 1": lambda: _read("/proc/1/environ"),
        "read the server's environment": lambda: _read(f"/proc/{server}/environ"),
        "read the server's memory": lambda: _read(f"/proc/{server}/mem"),
        "connect by TCP": lambda: _connect(socket.AF_INET, socket.SOCK_STREAM, ("127.0.0.1", targets["tcp_port"])),
        "send by UDP": lambda: _connect(socket.AF_INET, socket.SOCK_DGRAM, ("127.0.0.1", targets["udp_port"])),
        "connect to an abstract unix socket": lambda: _connect(socket.AF_UNIX, socket.SOCK_STREAM, targets["abstract"]),
        "listen": lambda: _HELD.append(socket.create_server(("127.0.0.1", 0))),
        "signal the server": lambda: os.kill(server, 0),
        "trace the server": lambda: _c("ptrace", _PTRACE_SEIZE, server, None, None),
        "make a user namespace": lambda: _c("unshare", _CLONE_NEWUSER),
        "mount": lambda: _c("mount", b"none", str(out).encode(), b"tmpfs", 0, None),
        "keep memory in a file without a name": lambda: _HELD.append(os.memfd_create("held")),
        "fork": _fork,
        "execute a program": _execute,
    }


def _read(path: str) -> None:
    """Read a file, and fail on an empty one: the environment of bubblewrap's own process 1 is empty, which proves nothing."""
    with open(path, "rb") as file:
        if not file.read(1):
            raise OSError(errno.ENODATA, os.strerror(errno.ENODATA))


def _write(path: Path) -> None:
    with open(path, "xb") as file:
        file.write(b"x")
    path.unlink()


def _connect(family: int, kind: int, address: Any) -> None:
    with socket.socket(family, kind) as made:
        made.settimeout(2)
        if isinstance(address, list):
            address = tuple(address)
        made.connect(address)
        made.send(b"x")


def _c(name: str, *arguments: Any) -> None:
    if getattr(_libc, name)(*arguments) < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _fork() -> None:
    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)


def _execute() -> None:
    say = "import json; print(json.dumps({'execute a program': 'allowed'}))"
    os.execv(sys.executable, [sys.executable, "-I", "-S", "-c", say])


def main() -> None:
    attempt_all(enter(), json.loads(sys.argv[1]))


def attempt_all(entered: Entered, targets: dict[str, Any]) -> None:
    for name, attempt in tries(targets, entered.job, entered.out).items():
        try:
            attempt()
        except OSError as error:
            result = f"refused: {errno.errorcode.get(error.errno or 0, str(error))}"
        else:
            result = "allowed"
        print(json.dumps({name: result}), flush=True)


if __name__ == "__main__":
    main()
