"""Does everything that a render needs work on this machine? A line each."""

from __future__ import annotations

import platform
from collections.abc import Callable
from pathlib import Path

from ...errors import SettingsError
from ...report.report import package_versions, usable_threads


def check_machine() -> list[dict[str, str | bool]]:
    """By name what was found of the CPU, the core, USD and colour management; `works` is false where it is why not."""
    versions = package_versions()
    checks: dict[str, Callable[[], str]] = {
        "primray": lambda: f"{versions['primray']}, python {versions['python']}",
        "cpu": lambda: f"{_cpu_model()}, {usable_threads()} usable threads",
        "core": _core,
        "usd": lambda: _usd(versions["usd"]),
        "images": lambda: _images(versions["openimageio"]),
        "colour": _color,
    }
    found: list[dict[str, str | bool]] = []
    for name, check in checks.items():
        try:
            found.append({"check": name, "works": True, "found": check()})
        except Exception as error:  # whatever it is, it is the answer
            found.append({"check": name, "works": False, "found": str(error)})
    return found


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def _core() -> str:
    from ... import core

    embree = core.versions().get("embree", "unknown")
    return f"{core.isa()}, {core.lanes()} lanes, Embree {embree}"


def _usd(version: str) -> str:
    from ... import usd  # noqa: F401 - whether it can be imported is the question

    return f"usd-core {version}"


def _images(version: str) -> str:
    import OpenImageIO as oiio

    return f"OpenImageIO {oiio.VERSION_STRING or version}"


def _color() -> str:
    from ...color.ocio import assumed_space, check_view, config_name, displays, failing_views, looks, views

    display, view = check_view(None)
    listed = {"displays": displays(), f"views of {display}": views(), "looks": looks() or ["none"]}
    lines = [f"{config_name()}: {display}, {view}", *(f"{k}: {', '.join(v)}" for k, v in listed.items())]
    if (assumed := assumed_space()) is not None:
        lines.append(assumed)
    failing = [f"{view} of {display} fails: {reason}" for display, view, reason in failing_views()]
    if failing:
        raise SettingsError("\n".join([*failing, *lines]), code="ocio-config")
    return "\n".join(lines)
