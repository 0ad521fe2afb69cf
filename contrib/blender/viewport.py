# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport's picture: a stage that is kept open in a process of its own, and edits of it as Blender tells of changes.

What only moves is written into the stage at once. For anything else the scene is exported again: the exporter takes what has
not changed from before, and what differs is written into the stage. Knows neither windows nor the GPU, and imports nothing of
Blender: `Preview` is given dependency graphs and view matrices, and has arrays of pixels.
"""

from __future__ import annotations

import math
import shutil
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .processes import Lines, ProcessError
from .usd_export.placement import light_rows, local_rows

Matrix = Sequence[Sequence[float]]  # 4 rows, for column vectors, as Blender's are
FOCAL = 0.5  # focal length of views that have none, in tenths of the scene's unit
NEAREST = 1e-3


@dataclass(frozen=True)
class Picture:
    """Pixels (H, W, 4), scene-linear with premultiplied alpha, the bottom row first. `edition`: of the change that it shows."""

    pixels: np.ndarray
    edition: int
    samples: float
    is_draft: bool
    is_finished: bool
    relmse: float | None


@dataclass(frozen=True)
class Lens:
    """Depth of field of a camera that is looked through, lengths in scene units; f-stop 0: none."""

    focal: float = FOCAL / 10
    fstop: float = 0.0
    focus: float = 0.0


def camera_of(view: Matrix, projection: Matrix, lens: Lens = Lens(), distance: float = 0.0) -> dict[str, Any]:
    """Return the camera of a view matrix and a projection (RegionView3D's view_matrix and window_matrix).

    `distance` is that of what is looked at, 0 if it is not known: points stay where they are while the camera goes around it.
    """
    p = np.asarray(projection, float)
    placed = np.linalg.inv(np.asarray(view, float))
    is_flat = p[3, 3] == 1.0
    if is_flat:
        length = -2 / p[2, 2]
        near = (-p[2, 3] * length - length) / 2
        # The near plane of orthographic views may be behind them.
        back = max(NEAREST - near, 0.0)
        placed[:3, 3] += placed[:3, 2] * back
        clip = (near + back, near + back + length)
        size = [20 / p[0, 0], 20 / p[1, 1]]
        offset = [-10 * p[0, 3] / p[0, 0], -10 * p[1, 3] / p[1, 1]]
    else:
        clip = (p[2, 3] / (p[2, 2] - 1), p[2, 3] / (p[2, 2] + 1))
        film = 10 * lens.focal
        size = [2 * film / p[0, 0], 2 * film / p[1, 1]]
        offset = [film * p[0, 2] / p[0, 0], film * p[1, 2] / p[1, 1]]
    return {
        "rows": placed.T.tolist(), "projection": "orthographic" if is_flat else "perspective", "clip": [float(c) for c in clip],
        "size": [float(s) for s in size], "offset": [float(o) for o in offset], "focal": 10 * lens.focal,
        "fstop": 0.0 if is_flat else lens.fstop, "focus": lens.focus,
        "nearest": 2.0 ** math.floor(math.log2(distance / 2)) if distance > 0 else 0.0,
    }  # fmt: skip


class Preview:
    """What one viewport shows. Called by one thread; `changed` is called by any, with True where `update` is wanted again.

    `start_exporter` and `start_renderer` start the two processes, given whom to call with each answer.
    """

    def __init__(
        self,
        start_exporter: Callable[[Callable[[Any], None]], Lines],
        start_renderer: Callable[[Callable[[Any], None]], Lines],
        folder: Path,
        changed: Callable[[bool], None] = lambda _: None,
    ) -> None:
        self._starters = {"exporter": start_exporter, "renderer": start_renderer}
        self._processes: dict[str, Lines] = {}
        self._folder = folder
        self._changed = changed
        self._lock = threading.RLock()
        self._stage: dict[str, Any] | None = None  # what the last export answered
        self._edits: dict[str, dict[str, Any]] = {}  # since that export was asked for, by path
        self._is_exporting = self._is_stale = False
        self.exports = 0  # how many have been asked for
        self._sent: dict[str, Any] = {}  # camera, size and settings
        self._ended = False
        self.edition = 0  # number of the last change
        self.notes: list[dict[str, str]] = []
        self.exported: dict[str, int] = {}
        self.picture: Picture | None = None
        self._problems: dict[str, str] = {}  # by process

    @property
    def error(self) -> str:
        """What went wrong last, for the user; "": nothing."""
        return "; ".join(list(self._problems.values()))

    def update(self, depsgraph: Any, write_blend: Callable[[Path], None], request: Mapping[str, Any]) -> None:
        """Take what has changed; `write_blend` writes the scene to a file, `request` says what of it is shown."""
        with self._lock:
            edits, is_plain = self._edits_of(depsgraph)
            if edits:
                self._edits.update({edit["path"]: edit for edit in edits})
                self._tell({"edits": edits})
            if self._stage is None or not is_plain:
                self._is_stale = True
            if self._is_stale and not self._is_exporting:
                self._export(write_blend, request)

    def look(self, camera: Mapping[str, Any], size: tuple[int, int], settings: Mapping[str, Any]) -> None:
        """Look by a camera (`camera_of`), at a size in pixels; `settings` are samples, seed and threads."""
        with self._lock:
            wanted = {"camera": dict(camera), "size": list(size), "settings": dict(settings)}
            if wanted != self._sent:
                self._sent = wanted
                self._tell(wanted)

    @property
    def stage(self) -> str:
        """The stage that was exported last; what has moved since is not in it."""
        return "" if self._stage is None else str(self._stage["stage"])

    def cancel(self) -> None:
        """End the render in progress; the next change begins another one."""
        with self._lock:
            if "renderer" in self._processes:
                self._send("renderer", stop=True)

    def end(self) -> None:
        with self._lock:
            self._ended = True
            processes, self._processes = list(self._processes.values()), {}
        for process in processes:
            process.end()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _edits_of(self, depsgraph: Any) -> tuple[list[dict[str, Any]], bool]:
        """Return edits of the places of what has moved, and whether nothing else has changed."""
        edits, is_plain = [], True
        places = {} if self._stage is None else self._stage["places"]
        for update in depsgraph.updates:
            of = update.id
            kind = of.bl_rna.identifier
            if not (update.is_updated_transform or update.is_updated_geometry or update.is_updated_shading):
                continue
            if kind == "Camera" or (kind == "Object" and of.type == "CAMERA"):
                continue  # the view says where it is looked from
            name = of.original.name
            is_moved = kind == "Object" and not (update.is_updated_geometry or update.is_updated_shading)
            rows = _rows_of(of, places.get(name)) if is_moved and name in places else None
            if rows is None:
                is_plain = False
            else:
                edits.append({"path": places[name]["path"], "rows": rows})
        return edits, is_plain

    def _export(self, write_blend: Callable[[Path], None], request: Mapping[str, Any]) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        blend = self._folder / "scene.blend"
        write_blend(blend)
        self.exports += 1
        self._is_stale, self._is_exporting, self._edits = False, True, {}
        self.edition += 1
        values = {
            "blend": str(blend),
            "folder": str(self._folder / f"stage-{self.exports}"),
            "edition": self.edition,
            **request,
        }
        try:
            self._send("exporter", **values)
        except ProcessError as error:
            self._fail("exporter", f"Blender's exporter: {error}")

    def _tell(self, changes: Mapping[str, Any]) -> None:
        """Tell the renderer of changes; all there is if it has just been started."""
        self.edition += 1
        if self._stage is None:
            return
        if "renderer" not in self._processes:
            changes = {**self._sent, "open": self._stage["stage"], "edits": list(self._edits.values())}
        try:
            self._send("renderer", edition=self.edition, pixels=str(self._folder / "pixels"), **changes)
            self._problems.pop("renderer", None)
        except ProcessError as error:
            self._fail("renderer", f"primray: {error}")

    def _send(self, which: str, **values: Any) -> None:
        if which not in self._processes:
            self._processes[which] = self._starters[which](lambda answer: self._answered(which, answer))
        self._processes[which].send(**values)

    def _fail(self, which: str, message: str) -> None:
        """Note what went wrong; a process that has ended is started again by the next change."""
        self._problems[which] = message
        process = self._processes.pop(which, None)
        if process is not None:
            process.end()
        if which == "exporter":
            self._is_exporting = False
            self._is_stale = True

    def _answered(self, which: str, answer: dict[str, Any] | None) -> None:
        """Take an answer of a process, in a thread that reads it; None: the process has ended."""
        with self._lock:
            if self._ended or which not in self._processes:
                return
            if answer is None:
                words = self._processes[which].last_words()
                self._fail(which, f"Blender's exporter: {words}" if which == "exporter" else f"primray: {words}")
            elif which == "exporter":
                self._take_stage(answer)
            else:
                self._take_picture(answer)
            is_wanted = self._is_stale and not self._is_exporting and not self.error
        self._changed(is_wanted)

    def _take_stage(self, answer: dict[str, Any]) -> None:
        self._is_exporting = False
        if "error" in answer:
            self._problems["exporter"] = f"the scene cannot be exported: {answer['error']}"
            return
        self._problems.pop("exporter", None)
        self._stage, self.notes, self.exported = answer, answer["notes"], answer["exported"]
        self._tell({"open": answer["stage"], "edits": list(self._edits.values()), **self._sent})

    def _take_picture(self, answer: dict[str, Any]) -> None:
        if "error" in answer:
            self._problems["renderer"] = answer["error"]
        elif "opened" in answer:
            used = Path(answer["opened"]).parent
            for folder in self._folder.glob("stage-*"):
                if int(folder.name[6:]) < int(used.name[6:]):
                    shutil.rmtree(folder, ignore_errors=True)
        elif "picture" in answer:
            _, rows, columns, channels = answer["picture"]["Combined"]
            pixels = np.fromfile(self._folder / "pixels", np.float32)
            if len(pixels) == rows * columns * channels:  # another one is on its way otherwise
                self.picture = Picture(
                    pixels.reshape(rows, columns, channels), answer["edition"], answer["samples"], answer["draft"],
                    answer["finished"], answer["relmse"],
                )  # fmt: skip


def _rows_of(obj: Any, place: Mapping[str, Any] | None) -> list[list[float]] | None:
    """Return the rows of an evaluated object's transform in the stage; None where an export has to say it."""
    if place is None:
        return None
    if place["kind"] == "light":
        return light_rows(obj.matrix_world, place["keeps_scale"], place["extra"])
    parent = obj.parent if place["parent"] else None
    if place["parent"] and (parent is None or parent.original.name != place["parent"]):
        return None
    return local_rows(obj.matrix_world, None if parent is None else parent.matrix_world, parent is not None)
