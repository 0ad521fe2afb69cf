"""Fitness of a node for work: tested when it is first seen, and again by each task before it opens anything."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field

from primray import __version__, core
from primray.core.native import runnable_isas
from primray.errors import PrimrayError

from ....files import DataDirectory
from ....sandbox import self_test
from .cache import node_folder
from .transfer import Wanted

NO_TOKEN = "its Ray accepts commands without a token: start it with RAY_AUTH_MODE=token"


@dataclass(frozen=True)
class Fitness:
    why: str  # why it takes no work; "" if it does
    sandbox: Mapping[str, str] = field(default_factory=dict)  # state of its layers


_fit: dict[str, Fitness] = {}  # a fit node stays fit


def wanted_here(allow_unsandboxed: bool) -> Wanted:
    """Return the properties of this process; PRIMRAY_ISA names an older class of CPUs, which more nodes may have."""
    needs_token = os.environ.get("RAY_AUTH_MODE") != "disabled"
    return Wanted(__version__, core.isa(), _build(), needs_token, allow_unsandboxed)


def _build() -> dict[str, str]:
    return {"core": core.build_digest(), **core.versions()}


def fitness(wanted: Wanted) -> Fitness:
    key = repr(wanted)
    if key not in _fit:
        found = _fitness(wanted)
        if found.why:
            return found
        _fit[key] = found
    return _fit[key]


def _fitness(wanted: Wanted) -> Fitness:
    if wanted.needs_token and os.environ.get("RAY_AUTH_MODE") != "token":
        return Fitness(NO_TOKEN)
    if (why := _another_build(wanted)) is not None:
        return Fitness(why)
    try:
        data = DataDirectory(node_folder())
        data.slots.mkdir(mode=0o700, exist_ok=True)
        found = self_test(data.slots)
    except OSError as error:
        return Fitness(f"its work folder cannot be used: {error}")
    if not found.ok and not wanted.allow_unsandboxed:
        return Fitness(f"the sandbox does not work there: {found.problem}", found.layers)
    return Fitness("", found.layers)


def _another_build(wanted: Wanted) -> str | None:
    """Return the difference in builds, or None if frames may move between this node and the others."""
    if __version__ != wanted.version:
        return f"it has primray {__version__}, the server has {wanted.version}"
    if wanted.isa not in runnable_isas():
        best = (runnable_isas() or ["less than v2"])[0]
        return f"its CPU is of class {best}, the server's of {wanted.isa}: set PRIMRAY_ISA={best} for the server"
    os.environ["PRIMRAY_ISA"] = wanted.isa  # for the core here, and for the workers that this process starts
    try:
        build = _build()
    except PrimrayError as error:
        return str(error)
    differs = [name for name in wanted.build if build.get(name) != wanted.build[name]]
    return f"it has another build of primray {__version__} (its {', '.join(differs)})" if differs else None
