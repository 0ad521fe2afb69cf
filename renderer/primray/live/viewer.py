"""The viewer thread: after each command it renders a draft and then the picture.

A draft is small and has few samples, so that a camera being dragged shows where it is; once it rests, the full picture is
rendered and refined. Of commands that wait only the last pose counts. Errors are reported in the state, and the last picture
stays.
"""

from __future__ import annotations

import logging
import math
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ..color import ocio
from ..core.native import unexpected
from ..denoising.denoiser import has_denoiser
from ..errors import PrimrayError, SettingsError
from ..images.writers import write_view
from ..settings import RenderSettings
from ..settings.choices import QUICK_LOOK
from .aov_pictures import SHOWN
from .commands import MEANWHILE, SETTINGS, STILL, order_of, stops_of, text_of
from .file_watch import FileWatch
from .lights import ShownLights, Weights, weights_of
from .pixel_explainer import as_json as explanation_json
from .viewed_scene import Size, View, ViewedScene

log = logging.getLogger("primray.live")

DRAFT_SPP = 2
FIRST_DRAFT = 4.0  # width of the first draft's pixels, before the picture's size is known
LOOK_SPP = QUICK_LOOK - 1  # samples of the full picture's first pass: more need pilot passes, which end later
RESTS_S = 0.2  # seconds without commands before the full picture is begun, and before it is refined
EVERY_S, MOST_SHARE = 0.3, 0.2  # least seconds between two pictures, and most share of time that showing them may take
TOLD_EVERY_S = 0.05  # least seconds between two reports of a step's progress
BRIEF_S = 0.3  # seconds of preparing that are not worth a word
STEPS = ("translate", "textures", "dice", "build")  # of preparing a scene, in their order


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture as a screen displays it. `number` increases with each."""

    number: int
    rgba: npt.NDArray[np.uint8]  # (H, W, 4), straight alpha
    token: str | None = None  # of the last command that it is the first to show


@dataclass(frozen=True)
class Looks:
    """Display settings of pictures; None is OpenColorIO's default."""

    view: str | None = None
    display: str | None = None
    look: str | None = None
    exposure: float | Literal["auto"] = 0.0  # stops
    weights: Weights = field(default_factory=dict)  # of lights, where pictures have them apart


class Ladder:
    """Resolution of drafts, by how long they take.

    The rung is left downwards after two drafts that took too long, and upwards after as many as HELD of which the next rung's
    would not: neither one slow draft nor a good one makes the picture jump between two sizes.
    """

    RUNGS = (12_000, 48_000, 192_000, 768_000)  # pixels
    AIM_S = 1 / 12
    TOLERANCE = 1.4
    HELD = 3

    def __init__(self) -> None:
        self._rung = 1
        self._slow = self._fast = 0

    @property
    def pixels(self) -> int:
        return self.RUNGS[self._rung]

    def pixel_size(self, whole: float) -> float:
        """Return the width of a draft's pixels in those of a picture of `whole` pixels."""
        return max(math.sqrt(whole / self.pixels), 1.0)

    def note(self, pixels: float, seconds: float) -> None:
        """Take account of a draft of so many pixels, which is less than the rung's where the whole picture is."""
        self._slow = self._slow + 1 if seconds > self.TOLERANCE * self.AIM_S else 0
        top = self._rung + 1 == len(self.RUNGS) or pixels < 0.9 * self.pixels
        grows = 1.0 if top else self.RUNGS[self._rung + 1] / self.pixels
        self._fast = self._fast + 1 if not top and seconds * grows < self.AIM_S else 0
        if self._slow >= 2 and self._rung > 0:
            self._rung, self._slow, self._fast = self._rung - 1, 0, 0
        elif self._fast >= self.HELD:
            self._rung, self._slow, self._fast = self._rung + 1, 0, 0


class Viewer:
    """Viewer of one stage. `changed` is called, from any thread, whenever `state` or `shown` would return something new."""

    def __init__(self, scene: ViewedScene, spp: int, looks: Looks, changed: Callable[[], None]) -> None:
        from ..core import compiled

        self._scene = scene
        self._spp = spp
        self._changed = changed
        self._news = threading.Condition()
        self._orders: list[tuple[Callable[[], object], str | None, float]] = []  # with their tokens and times of arrival
        self._questions: list[Callable[[], object]] = []  # orders that need not interrupt a render
        self._again = True  # the picture is out of date
        self._interrupted = False  # the picture is current, but was interrupted before it was finished
        self._closed = False
        self._is_idle = False  # waits for something to do
        self._unread: set[str] = set()  # changed files that could not be read yet
        self._problems: dict[str, PrimrayError] = {}  # by what went wrong: "files", "order", "render"
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._watch = FileWatch(self._files_changed)
        self._watch.watch([os.path.abspath(scene.path)] if isinstance(scene.source, str) else [], time.time_ns())
        self._looks = looks
        self._lights = ShownLights()
        self._looks_new = False
        self._view: View | None = None
        self._ladder = Ladder()
        self._whole_pixels = 0.0
        self._next_show = 0.0
        self._begun = 0.0
        self._told_at = 0.0
        self._asked: tuple[str | None, float] | None = None  # token and arrival of the orders that the next picture is of
        self._can = {"denoise": has_denoiser(), "aovs": SHOWN, **_displays()}
        self._cancellation = compiled.Cancellation()
        scene.cancellation, scene.on_progress = self._cancellation, self._tell_progress
        scene.on_explained = self._explained
        self.shown: Shown | None = None
        self._state: dict[str, Any] = {"phase": "opening", "picture": 0, "doing": None}

    def start(self) -> None:
        self._thread.start()
        self._watch.start()

    def close(self) -> None:
        """Stop, and return when no thread runs any more."""
        with self._news:
            self._closed = True
            self._cancellation.ask()
            self._news.notify_all()
        self._watch.close()
        self._thread.join()
        self._scene.stop()

    def tell(self, command: Mapping[str, Any]) -> None:
        """Run a command (`commands.order_of`); raise SettingsError for others.

        Three kinds change how pictures are shown and interrupt no render: {"do": "exposure", "stops": N or "auto"};
        {"do": "display", "view", "display", "look"}, names or null; and {"do": "mix", "weights"}, [R, G, B] by the names of
        lights. The "token" of a command is that of the first picture that shows what it did.
        """
        if command.get("do") == "exposure":
            self._show_with(replace(self._looks, exposure=stops_of(command)))
        elif command.get("do") == "display":
            view, display, look = (text_of(command, name) for name in ("view", "display", "look"))
            ocio.check_view(view, display)
            ocio.check_look(look)
            self._show_with(replace(self._looks, view=view, display=display, look=look))
        elif command.get("do") == "mix":
            self._show_with(replace(self._looks, weights=weights_of(command.get("weights"))))
        else:
            order, token = order_of(command), text_of(command, "token")
            is_still = command.get("do") in STILL
            run = lambda: self._change(lambda: order(self._scene), "order", is_still=is_still)  # noqa: E731
            if command.get("do") in MEANWHILE:
                with self._news:
                    self._questions.append(run)
                    self._news.notify_all()
            else:
                self._order(run, token)

    def saved(self, extension: str) -> bytes:
        """Return the picture that is shown as a file; SettingsError before the first one."""
        view, looks = self._view, self._looks
        if view is None:
            raise SettingsError("there is no picture yet", code="view-command")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"picture{extension}"
            if extension == ".png" and view.drawn is not None:
                write_view(view.drawn, str(path))
            elif extension == ".png":
                mixed = ShownLights().mixed(view.image, looks.weights)
                mixed.save(path, view=looks.view, display=looks.display, exposure=looks.exposure, look=looks.look)
            else:
                view.image.save(path)
            return path.read_bytes()

    def edited(self, taken: Callable[[], object] = lambda: None) -> None:
        """Render the stage again, which has been edited; `taken` is called from the thread before it does."""

        def take() -> None:
            self._change(self._scene.note_edits, "order")
            taken()

        self._order(take)

    @property
    def view(self) -> View | None:
        """What is shown; None before the first picture."""
        return self._view

    @property
    def problem(self) -> PrimrayError | None:
        """What prevents the picture that is wanted."""
        return next(iter(self._problems.values()), None)

    @property
    def is_at_rest(self) -> bool:
        """Whether the picture is finished, or cannot be made, and nothing waits."""
        with self._news:
            return self._is_idle and not self._has_work() and self._state["phase"] in ("finished", "failed")

    @property
    def path(self) -> str:
        return self._scene.path

    @property
    def looks(self) -> Looks:
        return self._looks

    @property
    def settings(self) -> RenderSettings:
        """The settings of a render of what is shown, but for its camera and samples."""
        return replace(self._scene.settings, variants=self._scene.variants)

    def camera_text(self) -> str:
        """Return the camera as the text of a USD layer to lay over the stage."""
        return self._scene.camera_text()

    def state(self) -> dict[str, Any]:
        """Return the state as JSON.

        "phase" is opening, drafting, preparing, rendering, finished or failed, with the "problem", and "diagnostics".
        "doing" is the step that preparing is at: "step", its "number" "of" how many, and how much of it is "done" of "all" (0:
        not known). "picture" is the number of the picture shown (0: none), which has "size", "samples", "relmse", "seconds",
        "step_s" (from the command to the picture) and the "token" of the last command that it shows. "cameras", "camera" (as
        authored), "moved", "variants", "times", "rate" (time codes a second), "set", "selected", "explained" (None, or what
        `pixel_explainer.as_json` returns), "aov", "denoise" and "lights" (None, or their "names", "weights"
        and the "relmse" of their mix) describe the view, "exposure" and "display" how it is shown,
        "can" what there is to choose.
        """
        with self._news:
            return dict(self._state)

    def _files_changed(self, files: set[str]) -> None:
        def read() -> None:
            self._unread |= files
            if self._change(lambda: self._scene.read_anew(self._unread), "files"):
                self._unread = set()

        self._order(read)

    def _order(self, order: Callable[[], object], token: str | None = None) -> None:
        with self._news:
            self._orders.append((order, token, time.monotonic()))
            self._cancellation.ask()
            self._news.notify_all()

    def _show_with(self, looks: Looks) -> None:
        with self._news:
            self._looks, self._looks_new = looks, True  # shown without interrupting the render
            self._news.notify_all()

    def _change(self, change: Callable[[], None], of: str, *, is_still: bool = False) -> bool:
        """Run a change of the scene; return whether it succeeded, so that the picture has to be rendered again."""
        self._problems.pop("order", None)
        with self._as_problem(of):
            change()
            self._problems.pop(of, None)
            self._again = self._again or not is_still
        self._scene.drop_outdated_explanation()
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
                self._is_idle = True
                self._news.wait_for(self._has_work)
                self._is_idle = False
                if self._closed:
                    return
                orders, self._orders = self._orders, []
                self._cancellation.clear()
            for order, token, arrived in orders:
                order()
                self._asked = token or (self._asked or (None, 0.0))[0], (self._asked or (None, arrived))[1]
            self._answer_questions()
            if self._looks_new and self._view is not None:
                self._show(self._view)
            self._looks_new = False
            if self._again or self._interrupted:
                draft, self._again = self._again, False
                self._render(draft)
            self._asked = None
            self._publish()

    def _has_work(self) -> bool:
        waiting = self._orders or self._questions or self._again or self._interrupted or self._looks_new
        return self._closed or bool(waiting)

    def _answer_questions(self) -> None:
        with self._news:
            questions, self._questions = self._questions, []
        for question in questions:
            question()
        if questions:
            self._publish()

    def _render(self, draft: bool) -> None:
        """Render a draft if one is wanted, then the full picture, unless there is something else to do by then."""
        self._problems.pop("render", None)
        self._interrupted = False
        scene = self._scene
        with self._as_problem("render"):
            if draft:
                self._publish("drafting")
                self._take_draft()
                self._watch.watch(scene.files(), scene.read_ns)
                self._publish()
            if scene.is_sketch:
                scene.prepare_ahead(self._ready)
                self._publish("preparing")
                return
            looked = self._refine(LOOK_SPP)
            if looked and not scene.is_exact:
                scene.prepare_ahead(self._ready)
                return
            self._interrupted = not (looked and self._refine(self._spp))
        if "render" in self._problems:
            self._watch.watch(scene.files(), scene.read_ns)

    def _ready(self) -> None:
        with self._news:
            self._interrupted = True
            self._news.notify_all()

    def _explained(self) -> None:
        """Have the state published; called from the thread that explains pixels."""
        with self._news:
            self._questions.append(lambda: None)
            self._news.notify_all()

    def _take_draft(self) -> None:
        pixel_size = self._ladder.pixel_size(self._whole_pixels) if self._whole_pixels else FIRST_DRAFT
        size = Size(pixel_size, DRAFT_SPP, is_draft=True, keeps_surfaces=True)
        start = time.monotonic()
        if self._take(size, lambda: self._closed) and self._view is not None:
            width, height = self._view.image.resolution
            self._ladder.note(width * height, time.monotonic() - start - self._scene.preparing_s)

    def _refine(self, spp: int) -> bool:
        """Return whether the full picture reached `spp` samples per pixel, after a pause without commands."""
        if self._is_wanted_within(RESTS_S):
            return False
        self._publish("rendering")
        is_look = spp < self._spp
        return self._take(Size(1.0, spp, keeps_surfaces=is_look and not self._scene.is_exact), self._is_wanted)

    def _is_wanted(self) -> bool:
        """Return whether there is something else to do, which needs the render to end."""
        self._answer_questions()
        return self._closed or bool(self._orders)

    def _is_wanted_within(self, seconds: float) -> bool:
        """Return whether there is something else to do by then. Questions are answered without holding the news, which whoever
        has the stage's lock may ask for."""
        end = time.monotonic() + seconds
        while not self._is_wanted():
            with self._news:
                left = end - time.monotonic()
                if not self._news.wait_for(lambda: self._closed or bool(self._orders or self._questions), left):
                    return False
        return True

    def _take(self, size: Size, ends: Callable[[], bool]) -> bool:
        self._begun = self._next_show = time.monotonic()
        before = self._view.samples if self._view is not None and size.spp > LOOK_SPP else 0.0

        def show(view: View) -> None:
            start = time.monotonic()
            self._whole_pixels = math.prod(view.image.resolution) * size.pixel_size**2
            self._show(view)
            self._publish("finished" if view.finished and size == Size(1.0, self._spp) else None)
            took = time.monotonic() - start
            self._next_show = time.monotonic() + max(EVERY_S, took * (1 / MOST_SHARE - 1))

        def is_due() -> bool:
            return self._looks_new or time.monotonic() >= self._next_show

        def show_better(view: View) -> None:
            if view.samples >= before or view.finished or self._looks_new:  # the first look has as many
                show(view)
            else:
                self._next_show = time.monotonic() + EVERY_S

        return self._scene.render(size, show_better, is_due, lambda: not ends())

    def _show(self, view: View) -> None:
        self._looks_new = False
        looks, number = self._looks, 1 if self.shown is None else self.shown.number + 1
        rgba = view.drawn
        if rgba is None:
            image = self._lights.mixed(view.image, looks.weights)
            rgba = image.to_uint8(view=looks.view, display=looks.display, exposure=looks.exposure, look=looks.look)
        self._view, self.shown = view, Shown(number, rgba, None if self._asked is None else self._asked[0])

    def _tell_progress(self, step: str, done: int, of: int) -> None:
        """Publish what a scene's preparation is at; called from whichever thread prepares it."""
        now = time.monotonic()
        is_brief = not self._scene.is_sketch and now < self._begun + BRIEF_S  # a step of an orbit
        if is_brief or (done and now < self._told_at + TOLD_EVERY_S):
            return
        self._told_at = now
        doing = {"step": step, "number": STEPS.index(step) + 1, "of": len(STEPS), "done": done, "all": of}
        with self._news:
            self._state = {**self._state, "doing": doing}
        self._changed()

    def _publish(self, phase: str | None = None) -> None:
        scene, view, problem = self._scene, self._view, self.problem
        explanation, is_outdated = scene.explanation, scene.is_explanation_outdated
        now = "failed" if problem is not None and not phase else phase or self._state["phase"]
        found: dict[str, Any] = {
            "phase": now,
            "problem": None if problem is None else {"code": problem.code, "message": problem.message, "where": problem.where},
            "cameras": scene.cameras,
            "camera": scene.authored_path,
            "moved": scene.orbit is not None,
            "variants": scene.variant_sets,
            "times": scene.times,
            "rate": scene.time_codes_per_second,
            "set": {name: _plain(getattr(scene.settings, name)) for name in SETTINGS},
            "selected": None
            if scene.selected is None
            else {name: getattr(scene.selected, name) for name in ("prim", "instance", "material", "distance")},
            "explained": None if explanation is None else explanation_json(explanation, is_outdated=is_outdated),
            "aov": scene.aov,
            "denoise": scene.denoises,
            "lights": self._lights.as_json(self._looks.weights) if scene.has_lights else None,
            "exposure": self._looks.exposure,
            "display": {"view": self._looks.view, "display": self._looks.display, "look": self._looks.look},
            "can": self._can,
        }
        if now not in ("drafting", "preparing", "opening"):
            found["doing"] = None
        if view is not None and self.shown is not None:
            found |= {
                "picture": self.shown.number,
                "size": list(view.image.resolution),
                "samples": view.samples,
                "relmse": None if view.relmse is None else [x if math.isfinite(x) else None for x in view.relmse],
                "diagnostics": view.diagnostics,
                "seconds": round(time.monotonic() - self._begun, 2),
            }
            if self._asked is not None and self.shown.number != self._state["picture"]:
                token, arrived = self._asked
                found |= {"step_s": round(time.monotonic() - arrived, 4), "token": token}
                self._asked = None
        with self._news:
            self._state = {**self._state, **found}
        self._changed()


def _displays() -> dict[str, Any]:
    """Return the names of displays, each with its views, and of looks."""
    return {"displays": {name: ocio.views(name) for name in ocio.displays()}, "looks": ocio.looks()}


def _plain(value: Any) -> Any:
    return getattr(value, "value", value)
