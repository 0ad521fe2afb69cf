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
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import interface
from .passes import passes, stamp
from .processes import Lines, ProcessError, exporter, find_python, renderer
from .viewport import Lens, Preview, camera_of

PARTS = shutil.ignore_patterns("objects.usdc", "materials.usdc")  # what a stage's layer has been composed of


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

    def view_update(self, context: Any, depsgraph: Any) -> None:
        show_changes(self._preview(), depsgraph)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        """Draw the newest picture. Without windows this cannot run: all that can be tested is in `Preview`."""
        preview, scene, region = self._preview(), depsgraph.scene, context.region
        size = (region.width, region.height)
        preview.look(_camera_of(context), size, view_settings(scene))
        interface.show_notes(preview.notes)
        picture = preview.picture
        if preview.error:
            self.update_stats("primray", preview.error)
        elif picture is not None:
            self.update_stats("primray", f"{picture.samples:g} of {scene.primray.preview_samples} samples")
        if picture is None:
            return
        rows, columns, _ = picture.pixels.shape
        values = gpu.types.Buffer("FLOAT", rows * columns * 4, picture.pixels.ravel())
        texture = gpu.types.GPUTexture((columns, rows), format="RGBA32F", data=values)
        gpu.state.blend_set("ALPHA_PREMULT")
        self.bind_display_space_shader(scene)
        draw_texture_2d(texture, (0, 0), *size)
        self.unbind_display_space_shader()
        gpu.state.blend_set("NONE")

    def _preview(self) -> Preview:
        """Return what this viewport shows; each viewport has an engine of its own, which ends it."""
        if getattr(self, "preview", None) is None:
            self.preview = preview_of(lambda is_wanted: self.tag_update() if is_wanted else self.tag_redraw())
        return self.preview

    def __del__(self) -> None:
        if (preview := getattr(self, "preview", None)) is not None:
            preview.end()

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
            transparent=exported["transparent"], layer=layer, names=exported["names"], time_code=exported["time_code"],
        )  # fmt: skip
        self._show(process, pixels, layer, exported)

    def _export(self, depsgraph: Any, scene: Any, layer: str) -> dict[str, Any] | None:
        self.update_stats("primray", "Exporting the scene")
        folder = KEPT.files()
        blend = folder / "scene.blend"
        write_blend(blend, scene)
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


class PrimraySaveStage(bpy.types.Operator):  # type: ignore[misc]
    bl_idname = "primray.save_stage"
    bl_label = "Save Stage"
    bl_description = "Save the stage that was rendered last, with what belongs to it, in a folder: for primray's commands"
    directory: bpy.props.StringProperty(subtype="DIR_PATH")  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        return bool(KEPT.stage) and Path(KEPT.stage).is_file()

    def invoke(self, context: Any, event: Any) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        try:
            shutil.copytree(Path(KEPT.stage).parent, bpy.path.abspath(self.directory), ignore=PARTS, dirs_exist_ok=True)
        except OSError as error:
            self.report({"ERROR"}, f"primray: {error}")
            return {"CANCELLED"}
        return {"FINISHED"}


def preview_of(changed: Callable[[bool], None]) -> Preview:
    """Return a viewport's preview, by processes of its own. Raises ProcessError where no Python has primray."""
    python = find_python(interface.preferred_python(), interface.own_folder())
    return Preview(
        lambda take: exporter(bpy.app.binary_path, take), lambda take: renderer(python, "live_renderer.py", take),
        Path(tempfile.mkdtemp(prefix="primray-view-")), changed,
    )  # fmt: skip


def show_changes(preview: Preview, depsgraph: Any) -> None:
    """Let a preview take what a dependency graph says has changed."""
    scene = depsgraph.scene
    request = {
        "scene": scene.name, "layer": depsgraph.view_layer.name, "frame": scene.frame_current,
        "subframe": scene.frame_subframe, "settings": {}, "needs_camera": False,
    }  # fmt: skip
    preview.update(depsgraph, lambda file: write_blend(file, scene), request)


def write_blend(file: Path, scene: Any) -> None:
    bpy.data.libraries.write(str(file), {scene}, path_remap="ABSOLUTE")


def _camera_of(context: Any) -> dict[str, Any]:
    """Return the camera that a 3D viewport looks by, with the lens of the scene's camera where it looks through that one."""
    region, space = context.region_data, context.space_data
    camera = (
        space.camera.data if region.view_perspective == "CAMERA" and space.camera and space.camera.type == "CAMERA" else None
    )
    lens = Lens()
    if camera is not None and camera.dof.use_dof and camera.type == "PERSP":
        at, focused = space.camera.matrix_world, camera.dof.focus_object
        ahead = at.to_3x3().col[2].normalized()
        distance = abs((focused.matrix_world.translation - at.translation).dot(ahead)) if focused else camera.dof.focus_distance
        lens = Lens(camera.lens / 1000, camera.dof.aperture_fstop, distance)
    distance = 0.0 if region.view_perspective == "CAMERA" else region.view_distance
    return camera_of(region.view_matrix, region.window_matrix, lens, distance)


def view_settings(scene: Any) -> dict[str, Any]:
    return {
        "samples": scene.primray.preview_samples, "seed": scene.primray.seed, "max_depth": scene.primray.max_depth or None,
        "threads": scene.render.threads if scene.render.threads_mode == "FIXED" else None,
        "transparent": scene.render.film_transparent,
    }  # fmt: skip


def never() -> bool:
    return False
