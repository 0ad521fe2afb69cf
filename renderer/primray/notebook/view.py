"""The widget: a view of a stage under a notebook's cell, by anywidget, for JupyterLab, VS Code and whatever else loads it."""

from __future__ import annotations

import atexit
import logging
import os
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

import anywidget
import traitlets

from ..errors import PrimrayError, SettingsError
from ..live.viewed_scene import ViewedScene
from ..live.viewer import Looks, Viewer
from ..render.render import with_setting_names
from ..settings import RenderSettings, with_values
from .courier import Courier
from .script import bundled
from .stage_lock import StageLock

if TYPE_CHECKING:
    from ..camera import Camera
    from ..images.image import Image
    from ..settings.written import SettingsValues

log = logging.getLogger("primray.notebook")

SPP = 1024  # a picture refines up to this many samples a pixel
WIDTH = 720  # pixels
GRACE_S = 2.0  # for which a view that no cell shows waits for another one
PAGE = Path(__file__).parent / "page"
LOCK = StageLock()
VIEWS: weakref.WeakSet[View] = weakref.WeakSet()
BEGUN = RenderSettings(spp=SPP, resolution=(WIDTH, 0))


class View(anywidget.AnyWidget):  # type: ignore[misc]
    """A view of a stage, given as a path or a Usd.Stage, as the last line of a cell.

        view = primray.notebook.View("shot.usda")
        view

    Drag to turn the camera, with Shift to move it; click to name a prim, with Ctrl to
    explain the pixel. Fields of RenderSettings may be passed by name;
    `view`, `display`, `look` and `exposure` are those of `Image.save`. Edits of `stage` are shown after the cell that makes
    them. Once no cell shows the view, its threads end and what it has made of the stage is freed, until it is shown again.

    `selected`: the prim that was clicked, a dict of "prim", "instance", "material", "distance" and "position", or None.
    `observe` calls functions as it changes, from a thread of the view's.
    """

    _esm = bundled(PAGE / "widget.js")
    _css = (PAGE / "widget.css").read_text(encoding="utf-8")
    selected = traitlets.Dict(default_value=None, allow_none=True, read_only=True)

    @with_setting_names
    def __init__(
        self,
        stage: str | os.PathLike[str] | Any,
        settings: RenderSettings = BEGUN,
        *,
        view: str | None = None,
        display: str | None = None,
        look: str | None = None,
        exposure: float | Literal["auto"] = 0.0,
        **values: Unpack[SettingsValues],
    ) -> None:
        settings = with_values(settings, {**values, "aovs": ()})
        from ..color import ocio

        ocio.check_view(view, display)
        ocio.check_look(look)
        self._looks = Looks(view, display, look, exposure)
        self._settings = settings
        self._fronts: set[str] = set()  # the cells' outputs that show it
        self._life = threading.RLock()  # held while threads are started or ended
        self._news = threading.Condition()
        self._viewer: Viewer | None = None
        self._courier: Courier | None = None
        self._scene: ViewedScene | None = None
        is_path = isinstance(stage, str | os.PathLike)
        scene = ViewedScene(os.fspath(stage) if is_path else stage, settings, lock=LOCK)
        scene.open()
        self._scene = scene
        super().__init__()
        self.on_msg(self._hear)
        VIEWS.add(self)
        if not is_path:
            LOCK.follow_cells(_show_edits)

    @property
    def stage(self) -> Any:
        """The Usd.Stage, to edit: what a cell or a callback of another widget edits is shown when it ends.

        While code runs that may edit it, pictures refine but the camera stays. Other threads edit it within `edit`; where there
        is no IPython, `edit` or `refresh` shows what has been edited.
        """
        found = self._open_scene().stage
        LOCK.follow_cells(_show_edits)
        return found

    @contextmanager
    def edit(self) -> Iterator[Any]:
        """Provide the stage while nothing reads it, and show the edits."""
        scene = self._open_scene()
        with LOCK.held():
            yield scene.stage
        _show_edits()

    def refresh(self, timeout_s: float = 60.0) -> None:
        """Show what has been edited so far, and return when a picture does: for cells that edit in a loop.

        TimeoutError after `timeout_s`.
        """
        viewer, taken = self._wake(), list[int]()
        viewer.edited(lambda: taken.append(0 if viewer.shown is None else viewer.shown.number))
        self._until(
            lambda: bool(taken) and (viewer.state()["picture"] > taken[0] or viewer.state()["phase"] == "failed"), timeout_s
        )

    def wait(self, timeout_s: float = 600.0) -> Image:
        """Return the finished picture, with all edits so far; raise what prevents it, TimeoutError after `timeout_s`."""
        viewer = self._wake()
        if self._open_scene().is_edited():
            self.refresh(timeout_s)
        self._until(lambda: viewer.is_at_rest, timeout_s)
        if viewer.problem is not None:
            raise viewer.problem
        assert viewer.view is not None
        return viewer.view.image

    @property
    def image(self) -> Image | None:
        """The picture that is shown, with its errors; None before the first one."""
        viewer = self._viewer
        return None if viewer is None or viewer.view is None else viewer.view.image

    @property
    def camera(self) -> Camera | None:
        """The camera that the view is seen through, for `primray.render`; None before the first picture."""
        return self._open_scene().through

    @property
    def problem(self) -> PrimrayError | None:
        """What prevents a picture of the stage as it is now."""
        return None if self._viewer is None else self._viewer.problem

    def close(self) -> None:
        """End the view, wherever it is shown, and free all of it."""
        if getattr(self, "_scene", None) is not None:
            VIEWS.discard(self)
            self._sleep()
            self._scene = None
            self.send({"kind": "closed"})
        super().close()

    def _open_scene(self) -> ViewedScene:
        if self._scene is None:
            raise SettingsError("the view is closed", code="view-command")
        return self._scene

    def _wake(self) -> Viewer:
        """Return the viewer, started if it does not run."""
        scene = self._open_scene()
        with LOCK.released(), self._life:  # threads that are ended meanwhile may wait for the lock
            if self._viewer is None:
                viewer = Viewer(scene, self._settings.most_samples, self._looks, self._changed)
                self._viewer, self._courier = viewer, Courier(viewer, self.send, self._note, self._news)
                viewer.start()
                self._courier.start()
            return self._viewer

    def _sleep(self) -> None:
        """End all threads, and free what has been made of the stage."""
        with LOCK.released(), self._life:
            viewer, courier, scene = self._viewer, self._courier, self._scene
            self._viewer = self._courier = None
            if courier is not None:
                courier.close()
            if viewer is not None:
                self._looks = viewer.looks
                viewer.close()
            if scene is not None:
                scene.free()

    def _sleep_unless_shown(self) -> None:
        time.sleep(GRACE_S)
        with LOCK.released(), self._life:  # a cell that shows it from now on wakes it afterwards
            if not self._fronts:
                self._sleep()

    def _changed(self) -> None:
        courier = self._courier
        if courier is not None:
            courier.changed()
        with self._news:
            self._news.notify_all()

    def _until(self, holds: Callable[[], bool], timeout_s: float) -> None:
        end = time.monotonic() + timeout_s
        with LOCK.released():
            while not holds():
                if time.monotonic() > end:
                    raise TimeoutError(f"the view has no picture of this after {timeout_s:g} s")
                with self._news:
                    self._news.wait(0.1)

    def _note(self, state: dict[str, Any]) -> None:
        scene = self._scene
        hit = None if scene is None or state.get("selected") is None else scene.selected
        found = None
        if hit is not None:
            found = {name: getattr(hit, name) for name in ("prim", "instance", "material", "distance")}
            found["position"] = tuple(hit.position.tolist())
        try:
            self.set_trait("selected", found)
        except Exception:  # of a function that observes it
            log.exception("a function that observes what is selected failed")

    def _hear(self, widget: object, content: Any, buffers: object) -> None:
        """Handle a message of the page."""
        kind, courier = content.get("kind"), self._courier
        if kind == "shown" and self._scene is not None:
            self._fronts.add(str(content.get("front")))
            self._wake()
            assert self._courier is not None
            self._courier.begin_again()
        elif kind == "gone":
            self._fronts.discard(str(content.get("front")))
            threading.Thread(target=self._sleep_unless_shown, name="sleep", daemon=True).start()
        elif kind == "drawn" and courier is not None:
            courier.drawn(content.get("number"))
        elif kind == "command":
            self.send({"kind": "answer", "id": content.get("id"), "problem": self._refusal(content.get("command"))})

    def _refusal(self, command: Any) -> dict[str, str] | None:
        """Carry out a command of the page; return why not."""
        viewer = self._viewer
        try:
            if viewer is None or not isinstance(command, dict):
                raise SettingsError("the view is closed", code="view-command")
            viewer.tell(command)
        except PrimrayError as error:
            return {"title": "It was refused", "detail": f"{error.code}: {error.message}", "where": error.where}
        return None


def _show_edits() -> None:
    """Have all views rendered again whose stages have been edited."""
    for view in list(VIEWS):
        scene, viewer = view._scene, view._viewer
        if scene is not None and viewer is not None and scene.is_edited():
            viewer.edited()


@atexit.register
def _sleep_all() -> None:
    for view in list(VIEWS):
        with suppress(Exception):
            view._sleep()
