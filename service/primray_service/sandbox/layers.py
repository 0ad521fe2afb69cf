"""Which walls stand on this machine: found out once, by trying."""

from __future__ import annotations

from functools import cache

from . import bubblewrap, landlock, seccomp

LAYERS = ("rlimits", "landlock", "seccomp", "bubblewrap")


@cache
def layers() -> dict[str, str]:
    """Each layer's name with "on" or "off: why"."""
    return {
        "rlimits": "on",
        "landlock": _landlock(),
        "seccomp": _seccomp(),
        "bubblewrap": "on" if (why := bubblewrap.missing()) is None else f"off: {why}",
    }


def usable_layers() -> frozenset[str]:
    return frozenset(name for name, state in layers().items() if state.startswith("on"))


def works(usable: frozenset[str] | None = None) -> bool:
    """Whether uploads of strangers may be opened: files are walled in, and system calls filtered."""
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
