"""Loads the shared libraries that a render needs on a thread, while Python imports modules.

The dynamic loader relocates USD's libraries for 50 to 80 ms. An import does that with the interpreter's lock held; called
through ctypes, `dlopen` runs without it, and the import that follows finds the libraries loaded. A library that is missing or
cannot be loaded is left to the import, which says what is wrong.
"""

from __future__ import annotations

import os
import sys
from importlib.machinery import EXTENSION_SUFFIXES, PathFinder
from pathlib import Path
from threading import Thread

# Extension modules in the order in which they are imported: USD's, and OpenImageIO's, which is needed once there is a picture.
USD = ("Tf", "Gf", "Vt", "Ar", "Plug", "Trace", "Ts", "Pcp", "Sdf", "Usd", "UsdGeom", "Sdr", "UsdShade", "UsdLux", "UsdUtils")
MODULES = (*(("pxr", f"{name}/_{name[0].lower()}{name[1:]}") for name in USD), ("OpenImageIO", "OpenImageIO"))


def load_ahead() -> None:
    """Begin to load the libraries that are installed."""
    if sys.platform == "linux":
        Thread(target=load, args=[installed()], name="libraries", daemon=True).start()


def installed() -> list[Path]:
    """Return the files of the extension modules that are there, first ones first; nothing is imported."""
    folders = {package: _folder_of(package) for package, _ in MODULES}
    places = [folder / module for package, module in MODULES if (folder := folders[package]) is not None]
    files = (place.with_name(place.name + suffix) for place in places for suffix in EXTENSION_SUFFIXES)
    return [file for file in files if file.is_file()]


def _folder_of(package: str) -> Path | None:
    found = PathFinder.find_spec(package)
    return None if found is None or not found.origin else Path(found.origin).parent


def load(files: list[Path]) -> None:
    """Load shared libraries without the interpreter's lock, each after those before it; one that cannot be is passed over."""
    import ctypes

    dlopen = ctypes.CDLL(None).dlopen
    dlopen.argtypes, dlopen.restype = [ctypes.c_char_p, ctypes.c_int], ctypes.c_void_p
    for file in files:
        dlopen(os.fsencode(file), os.RTLD_LAZY | os.RTLD_LOCAL)
