"""Tries to reach things, here or, as the text of a program, behind walls: each by its kind and what it is."""

import errno
import os
import socket


def tried(targets):
    """By name, "allowed", or "refused: why"."""
    ways = {
        "port": _connect_tcp,
        "socket": _connect_unix,
        "file": _read,
        "environment": lambda pid: _read(f"/proc/{pid}/environ"),
        "memory": lambda pid: _read(f"/proc/{pid}/maps"),
        "signal": lambda pid: os.kill(pid, 0),
        "folder": _list,
    }
    found = {}
    for kind, those in targets.items():
        for target in those:
            try:
                ways[kind](target)
            except OSError as error:
                found[f"{kind} {target}"] = f"refused: {errno.errorcode.get(error.errno or 0, error)}"
            else:
                found[f"{kind} {target}"] = "allowed"
    return found


def listening(pids):
    """TCP ports on which one of the processes listens."""
    inodes = set()
    for pid in pids:
        for handle in os.scandir(f"/proc/{pid}/fd"):
            try:
                inodes.add(os.readlink(handle.path))
            except OSError:
                continue
    ports = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        with open(table) as rows:
            for words in map(str.split, rows.readlines()[1:]):
                if words[3] == "0A" and f"socket:[{words[9]}]" in inodes:
                    ports.add(int(words[1].rpartition(":")[2], 16))
    return sorted(ports)


def _connect_tcp(port):
    for address in ("127.0.0.1", "::1"):
        try:
            socket.create_connection((address, port), 2).close()
            return
        except OSError as error:
            last = error
    raise last


def _connect_unix(path):
    with socket.socket(socket.AF_UNIX) as made:
        made.settimeout(2)
        made.connect(path)


def _read(path):
    """An empty one tells nothing."""
    with open(path, "rb") as file:
        if not file.read(1):
            raise OSError(errno.ENODATA, "empty")


def _list(path):
    if not os.listdir(path):
        raise OSError(errno.ENODATA, "empty")


def held():
    """What a process has been left with."""
    variables = sorted(name for name in os.environ if "RAY" in name.replace("PRIMRAY", ""))
    open_files = []
    for handle in range(3, 256):
        try:
            open_files.append((handle, oct(os.fstat(handle).st_mode)))
        except OSError:
            continue
    return {
        "variables of Ray": f"allowed: {variables}" if variables else "refused: none",
        "open files": f"allowed: {open_files}" if open_files else "refused: none",
    }
