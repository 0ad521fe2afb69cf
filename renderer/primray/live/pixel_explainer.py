"""Pixels of a view explained beside it: in a thread, by a scene of their own, one at a time.

That scene shares the stage's translation with those that are looked at. It stays for the next pixel until `drop` frees it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import PrimrayError
from ..explanation.explained import TITLES, ExplainedPixel, Explainer, explained
from ..explanation.text import has_rare, most_of

if TYPE_CHECKING:
    from ..core import compiled
    from ..explanation.parts import Part
    from ..incremental.scene import KeptStage
    from ..incremental.steps import CachedSteps
    from ..settings import RenderSettings

SPP = 64  # samples of a pixel, at most; its errors take 15 times as many further ones
MOST = 6  # parts of each split that are shown


class _CancelledError(Exception):
    """Nobody waits for the explanation any more."""


@dataclass(frozen=True)
class Explanation:
    """What is known of a pixel: nothing yet, its light in parts, or the problem that prevents them."""

    pixel: ExplainedPixel | None = None
    problem: PrimrayError | None = None


class PixelExplainer:
    """Explains pixels of one view. `explanation` is that of the last one that was asked for; None: of none."""

    def __init__(self) -> None:
        self.explanation: Explanation | None = None
        self._lock = threading.Lock()
        self._steps: CachedSteps | None = None
        self._thread: threading.Thread | None = None
        self._cancellation: compiled.Cancellation | None = None
        self._is_stopped = False

    def begin(self, kept: KeptStage, settings: RenderSettings, at: tuple[float, float], ended: Callable[[], None]) -> None:
        """Explain the pixel at a point of the frame, in 0 to 1 from its upper left corner, instead of any before.

        `ended` is called from the thread once `explanation` has changed.
        """
        from ..core import compiled

        self.cancel()
        before, steps, cancellation = self._thread, self._steps or kept.further_steps(), compiled.Cancellation()
        self._is_stopped = False

        def explain() -> None:
            if before is not None:
                before.join()
            if cancellation.is_asked:
                return
            steps.on_progress = self._check
            found = _explanation(Explainer(kept, steps), settings, at, cancellation)
            with self._lock:
                if found is None or cancellation.is_asked:
                    return
                self.explanation = found
            ended()

        self._steps, self._cancellation, self.explanation = steps, cancellation, Explanation()
        self._thread = threading.Thread(target=explain, name="explaining", daemon=True)
        self._thread.start()

    def cancel(self) -> None:
        """Want no explanation any more. Its thread ends after the render that it is at, once its scene is prepared."""
        with self._lock:
            if self._cancellation is not None:
                self._cancellation.ask()
            self.explanation = None

    def drop(self) -> None:
        """Cancel the explanation, and free its scene once the thread has ended."""
        self.cancel()
        self._steps = None

    def stop(self) -> None:
        """Drop the explanation, and return when the thread reads the stage no more."""
        self.drop()
        self._is_stopped = True
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None

    def _check(self, step: str, done: int, of: int) -> None:
        if self._is_stopped:  # else it is prepared to its end: what is interrupted is translated again, for the view, too
            raise _CancelledError


def _explanation(
    explainer: Explainer, settings: RenderSettings, at: tuple[float, float], cancellation: compiled.Cancellation
) -> Explanation | None:
    """Return the explanation of a pixel; None where it was cancelled."""
    from ..core.native import unexpected
    from ..core.scene import Cancelled

    def check() -> None:
        if cancellation.is_asked:
            raise _CancelledError

    try:
        render = explainer.prepare_at(*at, settings)
        render.prepared.scene.cancellation = cancellation
        return Explanation(explained(render, check=check))
    except (_CancelledError, Cancelled):
        return None
    except PrimrayError as error:
        return Explanation(problem=error)
    except Exception as error:  # the view goes on
        return Explanation(problem=unexpected(error, "this is a defect in primray"))


def as_json(explanation: Explanation, *, is_outdated: bool) -> dict[str, Any]:
    """Return what a page shows of an explanation: the largest parts of each split, with the rest as one."""
    found: dict[str, Any] = {"phase": "explaining", "problem": None, "outdated": is_outdated}
    pixel, problem = explanation.pixel, explanation.problem
    if problem is not None:
        said = {"code": problem.code, "message": problem.message, "where": problem.where}
        return found | {"phase": "failed", "problem": said}
    if pixel is None:
        return found
    return found | {
        "phase": "explained",
        "pixel": list(pixel.pixel),
        "samples": pixel.samples,
        "value": list(pixel.value),
        "error": None if pixel.error is None else list(pixel.error),
        "alpha": pixel.alpha,
        "rare": has_rare(pixel),
        "splits": [_split(TITLES[name], parts) for name, parts in pixel.splits.items()],
    }


def _split(title: str, parts: tuple[Part, ...]) -> dict[str, Any]:
    shown, count, share = most_of(parts, MOST)
    rows = [{"name": part.name, "share": part.share, "error": part.share_error, "rare": part.is_rare} for part in shown]
    return {"title": title, "parts": rows, "more": count, "more_share": share}
