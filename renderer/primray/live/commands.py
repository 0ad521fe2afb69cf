"""Commands to a viewer from outside: plain values, checked, as functions that its thread runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal

from ..errors import SettingsError
from ..settings import check_stops

if TYPE_CHECKING:
    from .viewed_scene import ViewedScene

Order = Callable[["ViewedScene"], None]
FARTHEST = 100.0  # picture heights, or steps of a wheel, at a time


def order_of(command: Mapping[str, Any]) -> Order:
    """Return the function for a command {"do": NAME, ...}; raise SettingsError ("view-command") for an invalid one.

    tumble, pan: "across", "down" as fractions of the picture's height; dolly: "steps", each nearer by a factor of e; frame,
    reset; camera: "path" (null: as the settings say); variant: "prim", "set", "name" ("": none).
    """
    make = _ORDERS.get(str(command.get("do")))
    if make is None:
        raise _refused(f"there is no command {command.get('do')!r}; there are {', '.join(_ORDERS)}")
    return make(command)


def stops_of(command: Mapping[str, Any]) -> float | Literal["auto"]:
    """Return the exposure of a command, in stops, or "auto"."""
    return "auto" if command.get("stops") == "auto" else check_stops(_number(command, "stops"), "stops")


def _tumble(command: Mapping[str, Any]) -> Order:
    across, down = _number(command, "across"), _number(command, "down")
    return lambda scene: scene.move(lambda orbit, camera: orbit.tumbled(across, down))


def _pan(command: Mapping[str, Any]) -> Order:
    across, down = _number(command, "across"), _number(command, "down")
    return lambda scene: scene.move(lambda orbit, camera: orbit.panned(across, down, camera))


def _dolly(command: Mapping[str, Any]) -> Order:
    steps = _number(command, "steps")
    return lambda scene: scene.move(lambda orbit, camera: orbit.dollied(steps, camera))


def _frame(command: Mapping[str, Any]) -> Order:
    def frame(scene: ViewedScene) -> None:
        box = scene.bounds
        if box is not None:
            scene.move(lambda orbit, camera: orbit.framed(box, camera))

    return frame


def _reset(command: Mapping[str, Any]) -> Order:
    return lambda scene: scene.reset()


def _camera(command: Mapping[str, Any]) -> Order:
    path = command.get("path")
    if path is not None and not isinstance(path, str):
        raise _refused("path must be the path of a camera, or null")
    return lambda scene: scene.look_through(path or None)


def _variant(command: Mapping[str, Any]) -> Order:
    prim, of_set, name = (_text(command, key) for key in ("prim", "set", "name"))
    return lambda scene: scene.choose(prim, of_set, name)


_ORDERS: dict[str, Callable[[Mapping[str, Any]], Order]] = {
    "tumble": _tumble,
    "pan": _pan,
    "dolly": _dolly,
    "frame": _frame,
    "reset": _reset,
    "camera": _camera,
    "variant": _variant,
}


def _number(command: Mapping[str, Any], name: str) -> float:
    value = command.get(name, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= FARTHEST:
        raise _refused(f"{name} must be a number from -{FARTHEST:g} to {FARTHEST:g}, not {value!r}")
    return float(value) if math.isfinite(value) else 0.0


def _text(command: Mapping[str, Any], name: str) -> str:
    value = command.get(name)
    if not isinstance(value, str):
        raise _refused(f"{name} must be text, not {value!r}")
    return value


def _refused(sentence: str) -> SettingsError:
    return SettingsError(sentence, code="view-command")
