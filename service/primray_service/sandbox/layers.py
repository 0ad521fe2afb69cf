"""Layers of the sandbox that work on this machine: tested once."""

from __future__ import annotations

from functools import cache

from . import bubblewrap, landlock, seccomp

LAYERS = ("rlimits", "landlock", "seccomp", "bubblewrap")


@cache
def layers() -> dict[str, str]:
    """Return each layer's name with "on" or "off: why"."""
    return {
        "rlimits": "on",
        "landlock": _landlock(),
        "seccomp": _seccomp(),
        "bubblewrap": "on" if (why := bubblewrap.missing()) is None else f"off: {why}",
    }


def usable_layers() -> frozenset[str]:
    return frozenset(name for name, state in layers().items() if state.startswith("on"))


def works(usable: frozenset[str] | None = None) -> bool:
    """Return whether untrusted uploads may be opened: file access is restricted, and system calls are filtered."""
    on = usable_layers() if usable is None else usable
    return "seccomp" in on and bool(on & {"landlock", "bubblewrap"})


def _landlock() -> str:
    try:
        return f"on (ABI {landlock.abi()})"
    except OSError as error:
        return f"off: {error.strerror or error}"


def _seccomp() -> str:
    try:
        seccomp.available()
    except OSError as error:
        return f"off: {error.strerror or error}"
    return "on"
