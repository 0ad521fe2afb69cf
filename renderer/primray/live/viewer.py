"""The viewer thread and its commands: after each command it renders a draft and then the picture.

A draft is small and has few samples, so that a camera being dragged shows where it is; once it rests, the full picture is
rendered and refined. Errors are reported in the state, and the last picture stays. Commands are plain values, which are checked
and become functions that the thread runs. Changed files are detected by polling: that works on every file system, and for files
that do not exist yet.
"""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from ..core.native import unexpected
from ..errors import PrimrayError, SettingsError
from ..settings import check_stops
from ..settings.choices import QUICK_LOOK
from .viewed_scene import Size, View, ViewedScene

if TYPE_CHECKING:
    from .viewed_scene import ViewedScene


LOOK_EVERY_S = 0.25

Stamp = tuple[int, int, int] | None  # time of modification (ns), size, inode; None: no such file


class FileWatch:
    """Calls `changed` with files that differ from when they were first checked, or last reported.

    A file is reported once it has stayed the same between two polls: a writer may still have been busy.
    """

    def __init__(self, changed: Callable[[set[str]], None], every_s: float = LOOK_EVERY_S) -> None:
        self._changed = changed
        self._every_s = every_s
        self._lock = threading.Lock()
        self._stamps: dict[str, Stamp] = {}
        self._unsettled: dict[str, Stamp] = {}
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="files", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._closed.set()
        self._thread.join()

    def watch(self, files: Collection[str], since_ns: int) -> None:
        """Watch these files from now on, which were read at `since_ns`: newer ones have changed. Known states are kept."""
        with self._lock:
            self._stamps = {file: self._stamps.get(file, _seen_at(file, since_ns)) for file in files}

    def look(self) -> set[str]:
        """Return files that have changed and are stable again."""
        with self._lock:
            now = {file: stamp_of(file) for file in self._stamps}
            differing = {file: stamp for file, stamp in now.items() if stamp != self._stamps[file]}
            settled = {file for file, stamp in differing.items() if self._unsettled.get(file, ()) == stamp}
            self._unsettled = {file: stamp for file, stamp in differing.items() if file not in settled}
            self._stamps.update({file: now[file] for file in settled})
        return settled

    def _run(self) -> None:
        while not self._closed.wait(self._every_s):
            if found := self.look():
                self._changed(found)


def _seen_at(file: str, time_ns: int) -> Stamp:
    stamp = stamp_of(file)
    return None if stamp is not None and stamp[0] > time_ns else stamp


def stamp_of(file: str) -> Stamp:
    try:
        found = os.stat(file)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


log = logging.getLogger("primray.live")

DRAFT_SPP, DRAFT_PIXELS = 2, 48_000
FIRST_DRAFT = 0.25  # scale of the first draft, before the picture's size is known
LOOK_SPP = QUICK_LOOK - 1  # samples of the full picture's first pass: more need pilot passes, which cannot be interrupted
RESTS_S = 0.2  # seconds without commands before the full picture is begun, and before it is refined
EVERY_S, MOST_SHARE = 0.3, 0.2  # least seconds between two pictures, and most share of time that showing them may take


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture as a screen displays it. `number` increases with each."""

    number: int
    rgba: npt.NDArray[np.uint8]  # (H, W, 4), straight alpha


@dataclass(frozen=True)
class Looks:
    """Display settings of pictures; None is OpenColorIO's default."""

    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float | Literal["auto"] = 0.0  # stops


class Viewer:
    """Viewer of one stage. `changed` is called, from any thread, whenever `state` or `shown` would return something new."""

    def __init__(self, scene: ViewedScene, spp: int, looks: Looks, changed: Callable[[], None]) -> None:
        self._scene = scene
        self._spp = spp
        self._changed = changed
        self._news = threading.Condition()
        self._orders: list[Callable[[], object]] = []
        self._again = True  # the picture is out of date
        self._interrupted = False  # the picture is current, but was interrupted before it was finished
        self._closed = False
        self._unread: set[str] = set()  # changed files that could not be read yet
        self._problems: dict[str, PrimrayError] = {}  # by what went wrong: "files", "order", "render"
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._watch = FileWatch(self._files_changed)
        self._watch.watch([os.path.abspath(scene.path)], time.time_ns())
        self._looks = looks
        self._looks_new = False
        self._view: View | None = None
        self._whole_pixels = 0.0
        self._next_show = 0.0
        self._begun = 0.0
        self.shown: Shown | None = None
        self._state: dict[str, Any] = {"phase": "opening", "picture": 0}

    def start(self) -> None:
        self._thread.start()
        self._watch.start()

    def close(self) -> None:
        """Stop, and return when no thread runs any more."""
        with self._news:
            self._closed = True
            self._news.notify_all()
        self._watch.close()
        self._thread.join()

    def tell(self, command: Mapping[str, Any]) -> None:
        """Run a command (`commands.order_of`), or {"do": "exposure", "stops": N or "auto"}; raise SettingsError for others."""
        if command.get("do") == "exposure":
            with self._news:
                self._looks = replace(self._looks, exposure=stops_of(command))
                self._looks_new = True  # shown without interrupting the render
                self._news.notify_all()
        else:
            order = order_of(command)
            self._order(lambda: self._change(lambda: order(self._scene), "order"))

    def state(self) -> dict[str, Any]:
        """Return the state as JSON: "phase" (opening, drafting, rendering, finished, failed), "problem", "diagnostics".

        "picture" is the number of the picture shown (0: none), which has "size", "samples", "relmse" and "seconds". "cameras",
        "camera" (as authored), "moved", "variants" and "exposure" describe the view.
        """
        with self._news:
            return dict(self._state)

    def _files_changed(self, files: set[str]) -> None:
        def read() -> None:
            self._unread |= files
            if self._change(lambda: self._scene.read_anew(self._unread), "files"):
                self._unread = set()

        self._order(read)

    def _order(self, order: Callable[[], object]) -> None:
        with self._news:
            self._orders.append(order)
            self._news.notify_all()

    def _change(self, change: Callable[[], None], of: str) -> bool:
        """Run a change of the scene; return whether it succeeded, so that the picture has to be rendered again."""
        self._problems.pop("order", None)
        with self._as_problem(of):
            change()
            self._problems.pop(of, None)
            self._again = True
        return of not in self._problems

    @contextmanager
    def _as_problem(self, of: str) -> Iterator[None]:
        try:
            yield
        except PrimrayError as error:
            self._problems[of] = error
        except Exception as error:
            log.exception("the viewer failed")
            self._problems[of] = unexpected(error, "this is a defect in primray")

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._closed or self._orders or self._again or self._looks_new)
                if self._closed:
                    return
                orders, self._orders = self._orders, []
            for order in orders:
                order()
            if self._looks_new and self._view is not None:
                self._show(self._view)
            self._looks_new = False
            if self._again or self._interrupted:
                draft, self._again = self._again, False
                self._render(draft)
            self._publish()

    def _render(self, draft: bool) -> None:
        """Render a draft if one is wanted, then the full picture, unless there is something else to do by then."""
        self._problems.pop("render", None)
        self._interrupted = False
        with self._as_problem("render"):
            if draft:
                self._publish("drafting")
                self._take(Size(self._draft_scale(), DRAFT_SPP), lambda: self._closed)
                self._watch.watch(self._scene.files(), self._scene.read_ns)
                self._publish()
            self._interrupted = not (self._refine(LOOK_SPP) and self._refine(self._spp))
        if "render" in self._problems:
            self._watch.watch(self._scene.files(), self._scene.read_ns)

    def _refine(self, spp: int) -> bool:
        """Return whether the full picture reached `spp` samples per pixel, after a pause without commands."""
        with self._news:
            if self._news.wait_for(self._is_wanted, RESTS_S):
                return False
        self._publish("rendering")
        return self._take(Size(1.0, spp), self._is_wanted)

    def _is_wanted(self) -> bool:
        """Return whether there is something else to do."""
        return self._closed or bool(self._orders)

    def _draft_scale(self) -> float:
        return min(math.sqrt(DRAFT_PIXELS / self._whole_pixels), 1.0) if self._whole_pixels else FIRST_DRAFT

    def _take(self, size: Size, ends: Callable[[], bool]) -> bool:
        self._begun = self._next_show = time.monotonic()

        def show(view: View) -> None:
            start = time.monotonic()
            self._whole_pixels = math.prod(view.image.resolution) / size.scale**2
            self._show(view)
            self._publish("finished" if view.finished and size == Size(1.0, self._spp) else None)
            took = time.monotonic() - start
            self._next_show = time.monotonic() + max(EVERY_S, took * (1 / MOST_SHARE - 1))

        def is_due() -> bool:
            return self._looks_new or time.monotonic() >= self._next_show

        return self._scene.render(size, show, is_due, lambda: not ends())

    def _show(self, view: View) -> None:
        self._looks_new = False
        looks, number = self._looks, 1 if self.shown is None else self.shown.number + 1
        rgba = view.image.to_uint8(view=looks.view, display=looks.display, exposure=looks.exposure, look=looks.look)
        self._view, self.shown = view, Shown(number, rgba)

    def _publish(self, phase: str | None = None) -> None:
        scene, view = self._scene, self._view
        problem = next(iter(self._problems.values()), None)
        found: dict[str, Any] = {
            "phase": "failed" if problem is not None and not phase else phase or self._state["phase"],
            "problem": None if problem is None else {"code": problem.code, "message": problem.message, "where": problem.where},
            "cameras": scene.cameras,
            "camera": scene.authored_path,
            "moved": scene.orbit is not None,
            "variants": scene.variant_sets,
            "exposure": self._looks.exposure,
        }
        if view is not None and self.shown is not None:
            found |= {
                "picture": self.shown.number,
                "size": list(view.image.resolution),
                "samples": view.samples,
                "relmse": None if view.relmse is None else [x if math.isfinite(x) else None for x in view.relmse],
                "diagnostics": view.diagnostics,
                "seconds": round(time.monotonic() - self._begun, 2),
            }
        with self._news:
            self._state = {**self._state, **found}
        self._changed()


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
