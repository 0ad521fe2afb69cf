"""Commands of clients: plain values, which are checked and become functions that the viewer's thread runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal

from ..errors import SettingsError
from ..settings import RenderSettings, check_stops
from .aov_pictures import SHOWN

if TYPE_CHECKING:
    from .viewed_scene import ViewedScene

Order = Callable[["ViewedScene"], None]
FARTHEST = 100.0  # picture heights, or steps of a wheel, at a time
# Settings that a page may change: lights and time.
SETTINGS = ("time_code", "dome", "dome_rotation", "dome_visible", "studio_light", "background")


def order_of(command: Mapping[str, Any]) -> Order:
    """Return the function for a command {"do": NAME, ...}; raise SettingsError ("view-command") for an invalid one.

    tumble, pan, look: "across", "down" as fractions of the picture's height; dolly: "steps", each nearer by a factor of e; fly:
    "ahead", "across", "up" as parts of the distance to what the camera goes around; pivot, select: "x", "y", a point of the
    picture from its upper left corner, in 0 to 1; explain: likewise, a pixel of which `explanation` then says what its light is
    made of; deselect, frame, reset; camera: "path" (null: as the settings say); variant:
    "prim", "set", "name" ("": none); set: values of SETTINGS by name; aov: "name" (null: the picture); denoise, lights: "on".
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


def _look(command: Mapping[str, Any]) -> Order:
    across, down = _number(command, "across"), _number(command, "down")
    return lambda scene: scene.move(lambda orbit, camera: orbit.looking(across, down))


def _pan(command: Mapping[str, Any]) -> Order:
    across, down = _number(command, "across"), _number(command, "down")
    return lambda scene: scene.move(lambda orbit, camera: orbit.panned(across, down, camera))


def _dolly(command: Mapping[str, Any]) -> Order:
    steps = _number(command, "steps")
    return lambda scene: scene.move(lambda orbit, camera: orbit.dollied(steps, camera))


def _fly(command: Mapping[str, Any]) -> Order:
    ahead, across, up = (_number(command, name) for name in ("ahead", "across", "up"))
    return lambda scene: scene.move(lambda orbit, camera: orbit.flown(ahead, across, up))


def _pivot(command: Mapping[str, Any]) -> Order:
    x, y = _point(command)
    return lambda scene: scene.turn_about(x, y)


def _select(command: Mapping[str, Any]) -> Order:
    x, y = _point(command)
    return lambda scene: scene.select(x, y)


def _explain(command: Mapping[str, Any]) -> Order:
    x, y = _point(command)
    return lambda scene: scene.explain(x, y)


def _deselect(command: Mapping[str, Any]) -> Order:
    return lambda scene: scene.deselect()


def _frame(command: Mapping[str, Any]) -> Order:
    return lambda scene: scene.frame()


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


def _set(command: Mapping[str, Any]) -> Order:
    values = {name: value for name, value in command.items() if name in SETTINGS}
    unknown = sorted(command.keys() - set(SETTINGS) - {"do", "token"})
    if unknown or not values:
        raise _refused(f"set takes {', '.join(SETTINGS)}" + (f", not {unknown[0]}" if unknown else ""))
    RenderSettings(**values)
    return lambda scene: scene.set(**values)


def _aov(command: Mapping[str, Any]) -> Order:
    name = command.get("name")
    if name is not None and name not in SHOWN:
        raise _refused(f"the AOVs that are shown are {', '.join(SHOWN)}, not {name!r}")

    def show(scene: ViewedScene) -> None:
        scene.aov = name

    return show


def _denoise(command: Mapping[str, Any]) -> Order:
    is_on = command.get("on")
    if not isinstance(is_on, bool):
        raise _refused(f"on must be true or false, not {is_on!r}")
    if is_on:
        from ..denoising.denoiser import check_denoiser

        check_denoiser()

    def denoise(scene: ViewedScene) -> None:
        scene.denoises = is_on

    return denoise


def _lights(command: Mapping[str, Any]) -> Order:
    is_on = command.get("on")
    if not isinstance(is_on, bool):
        raise _refused(f"on must be true or false, not {is_on!r}")

    def show(scene: ViewedScene) -> None:
        scene.has_lights = is_on

    return show


_ORDERS: dict[str, Callable[[Mapping[str, Any]], Order]] = {
    "tumble": _tumble,
    "look": _look,
    "pan": _pan,
    "dolly": _dolly,
    "fly": _fly,
    "pivot": _pivot,
    "select": _select,
    "explain": _explain,
    "deselect": _deselect,
    "frame": _frame,
    "reset": _reset,
    "camera": _camera,
    "variant": _variant,
    "set": _set,
    "aov": _aov,
    "denoise": _denoise,
    "lights": _lights,
}
# Those after which the picture is the same, and those of them that are carried out while one is rendered.
MEANWHILE = frozenset({"select", "explain", "deselect"})
STILL = MEANWHILE | {"pivot"}


def _number(command: Mapping[str, Any], name: str) -> float:
    value = command.get(name, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= FARTHEST:
        raise _refused(f"{name} must be a number from -{FARTHEST:g} to {FARTHEST:g}, not {value!r}")
    return float(value) if math.isfinite(value) else 0.0


def _point(command: Mapping[str, Any]) -> tuple[float, float]:
    x, y = _number(command, "x"), _number(command, "y")
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise _refused(f"x and y are from 0 to 1, not {x:g} and {y:g}")
    return x, y


def text_of(command: Mapping[str, Any], name: str) -> str | None:
    """Return a name of a command, or None where it is left open."""
    return None if command.get(name) is None else _text(command, name)


def _text(command: Mapping[str, Any], name: str) -> str:
    value = command.get(name)
    if not isinstance(value, str):
        raise _refused(f"{name} must be text, not {value!r}")
    return value


def _refused(sentence: str) -> SettingsError:
    return SettingsError(sentence, code="view-command")
