# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine: exports the scene in one process, renders it in another, and shows what that one draws."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from . import interface
from .passes import passes, stamp
from .processes import Lines, ProcessError, exporter, find_python, renderer


class Kept:
    """Processes and files that stay from frame to frame: Blender makes a new engine for each."""

    def __init__(self) -> None:
        self.exporter: Lines | None = None
        self.renderer: tuple[str, Lines] | None = None
        self.folder: Path | None = None
        self.notes: list[dict[str, str]] = []
        self.stage = ""
        self.exports = 0
        self.exported: dict[str, int] = {}  # objects and materials that the last frame did not take from earlier ones
        # Tests cancel by it: without windows nobody presses Escape.
        self.is_cancelled: Callable[[], bool] = lambda: False

    def exporting(self) -> Lines:
        if self.exporter is None or not self.exporter.is_alive:
            self.exporter = exporter(bpy.app.binary_path)
        return self.exporter

    def rendering(self, python: str) -> Lines:
        if self.renderer is None or self.renderer[0] != python or not self.renderer[1].is_alive:
            if self.renderer is not None:
                self.renderer[1].end()
            self.renderer = (python, renderer(python))
        return self.renderer[1]

    def files(self) -> Path:
        if self.folder is None:
            self.folder = Path(tempfile.mkdtemp(prefix="primray-"))
        return self.folder

    def end(self) -> None:
        for process in (self.exporter, self.renderer[1] if self.renderer else None):
            if process is not None:
                process.end()
        self.exporter = self.renderer = None
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)
            self.folder = None


KEPT = Kept()
atexit.register(KEPT.end)


class PrimrayEngine(bpy.types.RenderEngine):  # type: ignore[misc]
    bl_idname = "PRIMRAY"
    bl_label = "primray"
    bl_use_preview = False
    bl_use_postprocess = True
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def __init__(self, *arguments: Any, **values: Any) -> None:
        super().__init__(*arguments, **values)

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        for found in passes(scene, renderlayer):
            self.register_pass(scene, renderlayer, found.name, len(found.channels), found.channels, found.kind)

    def render(self, depsgraph: Any) -> None:
        try:
            self._render(depsgraph)
        except ProcessError as error:
            self.report({"ERROR"}, f"primray: {error}")
        except Exception as error:
            # An exception here would leave a render that looks finished.
            self.report({"ERROR"}, f"primray: {type(error).__name__}: {error}")

    def _is_cancelled(self) -> bool:
        return bool(self.test_break()) or KEPT.is_cancelled()

    def _render(self, depsgraph: Any) -> None:
        scene, layer = depsgraph.scene, depsgraph.view_layer_eval.name
        asked = scene.primray
        python = find_python(interface.preferred_python(), interface.own_folder())
        process = KEPT.rendering(python)  # starts while the scene is exported
        exported = self._export(depsgraph, scene, layer)
        if exported is None:
            return
        pixels = KEPT.files() / "pixels"
        process.send(
            stage=exported["stage"], pixels=str(pixels), seed=asked.seed,
            passes=[found.as_request() for found in passes(scene, depsgraph.view_layer_eval)],
            threads=scene.render.threads if scene.render.threads_mode == "FIXED" else None, every_s=asked.every_s,
            transparent=exported["transparent"], layer=layer, names=exported["names"],
        )  # fmt: skip
        self._show(process, pixels, layer, exported)

    def _export(self, depsgraph: Any, scene: Any, layer: str) -> dict[str, Any] | None:
        self.update_stats("primray", "Exporting the scene")
        folder = KEPT.files()
        blend = folder / "scene.blend"
        bpy.data.libraries.write(str(blend), {scene}, path_remap="ABSOLUTE")
        process = KEPT.exporting()
        asked = scene.primray
        # USD remembers layers by their paths: each export has a folder of its own, and the last one stays.
        shutil.rmtree(folder / f"stage-{KEPT.exports}", ignore_errors=True)
        KEPT.exports += 1
        stage = folder / f"stage-{KEPT.exports}"
        process.send(
            blend=str(blend), scene=scene.name, layer=layer, frame=scene.frame_current, subframe=scene.frame_subframe,
            folder=str(stage), settings=asked.as_request(),
        )  # fmt: skip
        try:
            answer = process.answer(self._is_cancelled)
        except ProcessError as error:
            raise ProcessError(f"Blender's exporter: {error}") from error
        if answer is None:
            process.end()  # it exports on by itself otherwise
            return None
        if "error" in answer:
            raise ProcessError(f"the scene cannot be exported: {answer['error']}")
        unsaved = [
            {"code": "image-unsaved", "object": image.name, "message": "the image has unsaved changes, which are not rendered"}
            for image in bpy.data.images
            if image.is_dirty and image.users and image.type == "IMAGE"
        ]
        KEPT.notes, KEPT.stage, KEPT.exported = [*answer["notes"], *unsaved], answer["stage"], answer["exported"]
        return answer

    def _show(self, process: Lines, pixels: Path, layer: str, exported: dict[str, Any]) -> None:
        """Show pictures as they come, until the last one."""
        stopping = False
        while True:
            answer = process.answer(never if stopping else self._is_cancelled)
            if answer is None:
                process.send(stop=True)
                stopping = True
                continue
            if "progress" in answer:
                self.update_progress(answer["progress"])
                self.update_stats("primray", f"Rendering {answer['progress']:.0%}")
            elif "picture" in answer:
                self._fill(answer["picture"], pixels, layer)
            elif "done" in answer:
                self._fill(answer["done"], pixels, layer)
                stamp(self.get_result(), answer["header"])
                KEPT.notes = [*KEPT.notes, *interface.named(answer["diagnostics"], exported["names"]["objects"])]
                interface.show_notes(KEPT.notes)
                interface.show_end({name: answer[name] for name in ("stop", "samples", "relmse")})
                self.update_stats("primray", interface.end_in_words())
                return
            elif "cancelled" in answer:
                return
            elif "error" in answer:
                raise ProcessError(answer["error"])

    def _fill(self, places: dict[str, list[int]], pixels: Path, layer: str) -> None:
        height, width, _ = places["Combined"][1:]
        mapped = np.memmap(pixels, np.float32, "r")
        result = self.begin_result(0, 0, width, height, layer=layer)
        if result is None or not result.layers:
            return
        for name, (at, rows, columns, channels) in places.items():
            target = result.layers[0].passes.get(name)
            if target is None or (rows, columns) != (height, width):
                continue
            values = np.ascontiguousarray(mapped[at : at + rows * columns * channels])
            target.rect.foreach_set(values)
        self.end_result(result)


def never() -> bool:
    return False
