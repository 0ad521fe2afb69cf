"""Table of executors by their configuration name; a module is imported when its executor is created."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module

from primray.errors import SettingsError

from .base import Executor

DEFAULT = "local"
# "module:function" beside this file; the function makes an executor from a ServeConfig and a DataDirectory.
EXECUTORS: Mapping[str, str] = {
    "local": "local:local_executor",
    "ray": "ray.executor:ray_executor",
}


def check_name(name: str) -> None:
    if name not in EXECUTORS:
        raise SettingsError(f"there is no executor {name!r}; there are: {', '.join(EXECUTORS)}", code="executor")


def executor_maker(name: str) -> Callable[..., Executor]:
    module, _, function = EXECUTORS[name].partition(":")
    make: Callable[..., Executor] = getattr(import_module(f".{module}", __package__), function)
    return make
