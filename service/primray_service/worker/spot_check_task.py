"""Spot check of a part that another machine rendered: random tiles are rendered again, and their bits compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from primray.checkpoints.checkpoint import load
from primray.distributed.spot_checks import TrustedScene
from primray.errors import CheckpointError
from primray.settings import RenderSettings

from ..sandbox import end_phase
from .channel import Channel
from .render_task import limit_images, settings_of


class PartChecks:
    """Checks of one frame's parts, whose scene stays ready in between."""

    def __init__(self) -> None:
        self._scene: tuple[str, RenderSettings, TrustedScene] | None = None

    def check(self, command: Mapping[str, Any], job: Path, out: Path, channel: Channel) -> None:
        """Check a part, and leave it with what is known of the scene here if it has the bits of a render."""
        channel.send("phase", phase="opening")
        settings, number = settings_of(command, job), int(command["number"]) + 1
        limit_images(command.get("limits") or {})
        span = settings.sample_range
        assert span is not None
        scene = self._scene_of(str(job / command["file"]), settings)
        end_phase()
        channel.send("phase", phase="sampling")
        try:
            part = load(job / str(command["part"]))
        except CheckpointError as error:
            return self._ends(command, channel, f"it cannot be read: {error.message}")
        random = np.random.default_rng(int(str(command["seed"]), 16))
        fault = scene.fault_of(part, span, random, int(command["tiles"]))
        if fault is None:
            file = out / f"checked-{span[0]}-{number}.prc"
            scene.write(part, span, file)
            said = {"file": file.name, "bytes": file.stat().st_size, "samples": float(span[1] - span[0])}
            channel.send("checkpoint", number=number, seconds=part.seconds, **said)
        return self._ends(command, channel, fault)

    def _scene_of(self, file: str, settings: RenderSettings) -> TrustedScene:
        """Return the scene; only ranges of samples differ between the parts of a frame."""
        of_all = replace(settings, sample_range=None)
        if self._scene is None or self._scene[:2] != (file, of_all):
            self._scene = None
            self._scene = file, of_all, TrustedScene(file, settings, outputs_follow=True)
        return self._scene[2]

    def _ends(self, command: Mapping[str, Any], channel: Channel, fault: str | None) -> None:
        channel.done(stay=bool(command.get("stay")), outputs=[], report={"parts": {"fault": fault}})
