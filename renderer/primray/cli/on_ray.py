"""`primray render --ray`: the Ray executor, provided by another package through the entry-point group `primray.executors`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

from ..errors import SettingsError

if TYPE_CHECKING:
    from ..parts.executor import PartsExecutor

GROUP, RAY = "primray.executors", "ray"


def ray_executor(address: str) -> AbstractContextManager[PartsExecutor]:
    """Return the executor for the Ray cluster at `address`; it connects when a frame begins.

    SettingsError if no package provides one.
    """
    from importlib.metadata import entry_points

    for entry in entry_points(group=GROUP, name=RAY):
        made: AbstractContextManager[PartsExecutor] = entry.load()(address)
        return made
    raise SettingsError("--ray needs the render service: pip install 'primray[server,ray]'", code="ray-missing")


def require_parts(flags: Mapping[str, Any]) -> None:
    """Raise SettingsError for flags that need a render on this machine."""
    for flag, value in flags.items():
        if value is not None:
            raise SettingsError(
                f"{flag} cannot be combined with --ray; it is for renders on this machine", code="parts-setting"
            )
