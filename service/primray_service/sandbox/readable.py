"""Paths that a worker must read to run Python, USD and the renderer, and nothing else: no home, no whole /usr, no /etc.

Editable installs are supported: of a checkout only the folders of the two packages are visible.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import sysconfig
from functools import cache

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
