"""A worker inside bubblewrap: an empty root with only what Python needs, and its own pid, network, user and mount namespaces.

This is the outermost layer, if the kernel and the server's container allow namespaces; the other layers work without it.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

JOB, OUT = "/job", "/out"
_TRY_S = 20.0


def wrap(slot: Path, environment: Mapping[str, str], command: Sequence[str], beside: Sequence[str] = ()) -> list[str]:
    """Return the argument list that runs a command with slot/job at /job (read-only) and slot/out at /out; `beside` is readable
    as well."""
    program = shutil.which("bwrap")
    if program is None:
        raise FileNotFoundError("bwrap")
    shown = [word for path in beside for word in ("--ro-bind", path, path)]
    return [program, *_root(_with_proc()), *shown, *_folders(slot), *_environment(environment), "--chdir", OUT, "--", *command]


# The program that keeps a worker's root and namespaces until a forked process has joined them, and as long as that runs: it
# waits for its input, and its first answer says that the root is made.
PARKED = "/cat"


def park(slot: Path, beside: Sequence[str] = ()) -> list[str]:
    """Return the argument list that makes the root of `wrap` around a program that only waits."""
    program, cat = shutil.which("bwrap"), shutil.which("cat")
    if program is None or cat is None:
        raise FileNotFoundError("bwrap" if program is None else "cat")
    shown = [word for path in beside for word in ("--ro-bind", path, path)]
    parked = ["--ro-bind", os.path.realpath(cat), PARKED]
    return [program, *_root(_with_proc()), *shown, *parked, *_folders(slot), "--chdir", "/", "--", PARKED]


def missing() -> str | None:
    """Return why it cannot be used here, or None; tried once."""
    if shutil.which("bwrap") is None:
        return "not installed"
    first = _trial(with_proc=True)
    if first is None:
        return None
    return first if _trial(with_proc=False) is not None else None


@cache
def _with_proc() -> bool:
    return _trial(with_proc=True) is None


@cache
def _trial(*, with_proc: bool) -> str | None:
    """Start Python in the empty root, and return the error, or None."""
    command = [shutil.which("bwrap") or "bwrap", *_root(with_proc), "--", sys.executable, "-I", "-S", "-c", "pass"]
    try:
        ended = subprocess.run(command, env={}, stdin=subprocess.DEVNULL, capture_output=True, timeout=_TRY_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    if ended.returncode == 0:
        return None
    lines = ended.stderr.decode("utf-8", "replace").strip().splitlines()
    return lines[0][:200] if lines else f"it ended with {ended.returncode}"


def _root(with_proc: bool) -> list[str]:
    arguments = ["--unshare-all", "--die-with-parent", "--new-session", "--clearenv", "--cap-drop", "ALL"]
    arguments += ["--uid", "65534", "--gid", "65534", "--hostname", "worker"]
    for path in readable_paths():
        if os.path.islink(path):  # /lib is a link on most systems
            arguments += ["--symlink", os.readlink(path), path]
        else:
            arguments += ["--ro-bind", path, path]
    for link, target in interpreter_links():
        if not _is_below(link, readable_paths()):
            arguments += ["--symlink", target, link]
    for device in (*DEVICES, "/dev/urandom", "/dev/zero"):
        arguments += ["--dev-bind", device, device]
    arguments += ["--ro-bind-try", "/sys/devices/system/cpu", "/sys/devices/system/cpu"]
    return [*arguments, *(["--proc", "/proc"] if with_proc else [])]


def _folders(slot: Path) -> list[str]:
    return ["--ro-bind", str(slot / "job"), JOB, "--bind", str(slot / "out"), OUT, "--remount-ro", "/"]


def _environment(environment: Mapping[str, str]) -> list[str]:
    return [word for name, value in environment.items() for word in ("--setenv", name, value)]


def _is_below(path: str, folders: Sequence[str]) -> bool:
    return any(path == folder or path.startswith(folder + "/") for folder in folders)


# Packages that a worker imports. pxr's plugins, Embree's and OpenBLAS's libraries are in or beside these packages.
_PACKAGES = ("primray", "primray_service", "pxr", "numpy", "OpenImageIO", "PyOpenColorIO", "embreex")
_LIBRARIES = ("/usr/lib", "/usr/lib64", "/usr/lib32", "/usr/local/lib", "/lib", "/lib64", "/lib32")
_FILES = ("/etc/ld.so.cache",)
# Number of cores and amount of memory, by which libraries size their pools.
_MACHINE = (
    "/sys/devices/system/cpu",
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/proc/self/maps",
    "/proc/self/status",
    "/proc/self/statm",
)
_RANDOM = ("/dev/urandom", "/dev/zero")
DEVICES = ("/dev/null",)


@cache
def readable_paths() -> tuple[str, ...]:
    """Return those folders and files that exist; earlier ones cover others below them."""
    found = [*_LIBRARIES, *_FILES, *_interpreter(), *_python_folders()]
    kept: list[str] = []
    for path in sorted(set(filter(os.path.exists, found))):
        if not any(path.startswith(above + "/") for above in kept):
            kept.append(path)
    return tuple(kept)


def machine_paths() -> tuple[str, ...]:
    """Return paths of kernel file systems that a worker reads as well; in a new root they are mounted in other ways."""
    return (*_MACHINE, *_RANDOM)


def interpreter_links() -> list[tuple[str, str]]:
    """Return the chain of symbolic links from sys.executable to the program: (link, target)."""
    links: list[tuple[str, str]] = []
    path = sys.executable
    while os.path.islink(path) and len(links) < 40:
        target = os.readlink(path)
        links.append((path, target))
        path = os.path.join(os.path.dirname(path), target)
    return links


def _interpreter() -> list[str]:
    venv = os.path.join(sys.prefix, "pyvenv.cfg")
    return [os.path.realpath(sys.executable), venv]


def _python_folders() -> list[str]:
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    folders = [sysconfig.get_path(name) for name in names]
    base = {"base": sys.base_prefix, "platbase": sys.base_exec_prefix, "installed_base": sys.base_prefix}
    folders += [sysconfig.get_path(name, vars=base) for name in ("stdlib", "platstdlib")]
    # A shared libpython is in the base installation's lib.
    library = sysconfig.get_config_var("LIBDIR")
    if isinstance(library, str) and sysconfig.get_config_var("Py_ENABLE_SHARED"):
        folders.append(library)
    for name in _PACKAGES:
        spec = importlib.util.find_spec(name)
        for place in (spec.submodule_search_locations or ()) if spec else ():
            above = os.path.dirname(place)
            folders.append(above if os.path.basename(above) in ("site-packages", "dist-packages") else place)
    return [os.path.abspath(folder) for folder in folders if folder]
