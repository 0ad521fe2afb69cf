"""One pixel of a job's picture in parts: what `primray explain` says of it, with the job's own settings.

The stage of the last pixel stays open, translated and built while the worker stays, so that the next one is quick.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from primray.explanation.explained import ExplainedPixel, Explainer
from primray.incremental.scene import KeptStage
from primray.render.prepare import composing_settings
from primray.settings import RenderSettings

from ..problems import Problem
from .channel import Channel
from .render_task import limit_images, settings_of

MOST_PARTS = 200  # of each split, the largest: a pixel of a large set has light of thousands of prims


class ExplainedStage:
    """The stage whose pixels are explained."""

    def __init__(self) -> None:
        self._known: tuple[tuple[str, object], KeptStage] | None = None

    def explain(self, command: Mapping[str, Any], job: Path, channel: Channel) -> None:
        """Explain a pixel, and end the process, or return if it is to stay; raises errors."""
        channel.send("phase", phase="opening")
        settings = settings_of(command, job)
        limit_images(command.get("limits") or {})
        kept = self._kept(str(job / command["file"]), settings)
        x, y = command["pixel"]
        shown = kept.translated(settings).frame.pixels  # a region, or the whole frame
        if x >= shown.width or y >= shown.height:
            sentence = f"The picture has {shown.width} x {shown.height} pixels, and none at {x} {y}."
            raise Problem("invalid-request", sentence, member="x" if x >= shown.width else "y", code="explain-pixel")
        found = Explainer(kept).explain(shown.x + x, shown.y + y, settings)
        channel.done(stay=bool(command.get("stay")), outputs=[], report=said_of(found))

    def _kept(self, file: str, settings: RenderSettings) -> KeptStage:
        key = file, composing_settings(settings)
        if self._known is None or self._known[0] != key:
            self._known = None  # two stages would need the memory of both
            self._known = key, KeptStage(file, settings)
        return self._known[1]


def said_of(found: ExplainedPixel) -> dict[str, Any]:
    """Return the pixel's JSON with the largest parts of each split, and how many others there are (`more`)."""
    said = found.as_json()
    splits: Mapping[str, list[Any]] = said["splits"]
    said["splits"] = {name: parts[:MOST_PARTS] for name, parts in splits.items()}
    said["more"] = {name: max(0, len(parts) - MOST_PARTS) for name, parts in splits.items()}
    return said
