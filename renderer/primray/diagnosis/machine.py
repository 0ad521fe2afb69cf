"""Checks of this machine: whether everything that a render needs works."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from ..errors import SettingsError
from ..report.report import package_versions, usable_threads


@dataclass(frozen=True)
class MachineCheck:
    """A check of one thing that renders need of a machine: what was found, or why it does not work.

    >>> [check.name for check in primray.doctor() if not check.works]
    []
    """

    name: str
    works: bool
    found: str

    def as_json(self) -> dict[str, str | bool]:
        return {"check": self.name, "works": self.works, "found": self.found}


def check_machine() -> tuple[MachineCheck, ...]:
    """Return checks of the CPU, the core, USD, images, colour management, volumes and the schemas' files."""
    versions = package_versions()
    checks: dict[str, Callable[[], str]] = {
        "primray": lambda: f"{versions['primray']}, python {versions['python']}",
        "cpu": lambda: f"{_cpu_model()}, {usable_threads()} usable threads",
        "core": _core,
        "usd": lambda: _usd(versions["usd"]),
        "images": lambda: _images(versions["openimageio"]),
        "colour": _color,
        "volumes": _volumes,
        "schemas": _schemas,
    }
    return tuple(_checked(name, check) for name, check in checks.items())


def _checked(name: str, check: Callable[[], str]) -> MachineCheck:
    try:
        return MachineCheck(name, True, check())
    except Exception as error:  # any failure is the result of the check
        return MachineCheck(name, False, str(error))


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def _core() -> str:
    from .. import core

    embree = core.versions().get("embree", "unknown")
    return f"{core.isa()}, {core.lanes()} lanes, Embree {embree}"


def _usd(version: str) -> str:
    from .. import usd  # noqa: F401 - whether it can be imported is the question

    return f"usd-core {version}"


def _images(version: str) -> str:
    import OpenImageIO as oiio

    return f"OpenImageIO {oiio.VERSION_STRING or version}"


def _volumes() -> str:
    return f"OpenVDB files, with blosc {metadata.version('blosc')}"


def _schemas() -> str:
    from ..installed_packages import SCHEMAS, schema_folder

    folder = schema_folder()
    if not (folder / "plugInfo.json").is_file():
        raise SettingsError(f"{folder} has no plugInfo.json", code="schemas")
    return f"{folder}: with this folder on {SCHEMAS}, other programs know primray's attributes"


def _color() -> str:
    from ..color.ocio import assumed_space, check_view, config_name, displays, failing_views, looks, views

    display, view = check_view(None)
    listed = {"displays": displays(), f"views of {display}": views(), "looks": looks() or ["none"]}
    lines = [f"{config_name()}: {display}, {view}", *(f"{k}: {', '.join(v)}" for k, v in listed.items())]
    if (assumed := assumed_space()) is not None:
        lines.append(assumed)
    failing = [f"{view} of {display} fails: {reason}" for display, view, reason in failing_views()]
    if failing:
        raise SettingsError("\n".join([*failing, *lines]), code="ocio-config")
    return "\n".join(lines)
