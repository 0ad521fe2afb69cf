# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a scene, preferences, and the panels: when to stop, and what is not rendered as in Blender."""

from __future__ import annotations

from typing import Any

import bpy

from . import processes

PACKAGE = __package__ or "primray"
NOTES: list[dict[str, str]] = []  # of the last render
END: dict[str, Any] = {}  # of the last render: why it stopped, its samples (least and most of a pixel), its relMSE


class PrimraySettings(bpy.types.PropertyGroup):  # type: ignore[misc]
    samples: bpy.props.IntProperty(name="Samples", default=128, min=1, max=1 << 20, description="Most samples of a pixel")  # type: ignore[valid-type]
    preview_samples: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Viewport Samples", default=32, min=1, max=1 << 20, description="Most samples of a pixel in viewports"
    )
    target_error: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Target Error", default=0.0, min=0.0, max=10.0, precision=5,
        description="Stop when the picture's relative mean square error is estimated to be at most this; 0: by samples or time",
    )  # fmt: skip
    time_limit: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Time Limit",
        default=0.0,
        min=0.0,
        unit="TIME_ABSOLUTE",
        description="Stop after these seconds of sampling; 0: no limit",
    )
    max_depth: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Depth", default=0, min=0, max=1 << 20, description="Most scatterings of a path; 0: no limit"
    )
    seed: bpy.props.IntProperty(name="Seed", default=0, min=0, description="Another seed gives other noise")  # type: ignore[valid-type]
    denoise: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Denoised Pass", default=False, description="Add a denoised picture as the pass Denoised; Combined stays as it is"
    )
    error_pass: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Error Pass", default=False, description="Add the standard error of each pixel as the pass Error"
    )
    error_overlay: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Error Overlay",
        default=False,
        description="Add the picture coloured by its relative standard error as the pass Error Overlay",
    )
    every_s: bpy.props.FloatProperty(name="Update", default=1.0, min=0.1, description="Seconds between pictures that refine")  # type: ignore[valid-type]

    def as_request(self) -> dict[str, Any]:
        return {
            "samples": self.samples,
            "targetError": self.target_error,
            "timeLimit": self.time_limit,
            "maxDepth": self.max_depth,
            "denoise": self.denoise,
        }


class PrimrayPreferences(bpy.types.AddonPreferences):  # type: ignore[misc]
    bl_idname = PACKAGE
    python: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python",
        subtype="FILE_PATH",
        description="A Python that has primray, or its environment's folder; empty: looked for",
    )

    def draw(self, context: Any) -> None:
        self.layout.prop(self, "python")
        try:
            self.layout.label(text=f"Found: {processes.find_python(self.python, own_folder())}", icon="CHECKMARK")
        except processes.ProcessError as error:
            self.layout.label(text=str(error), icon="ERROR")
        row = self.layout.row()
        row.enabled = bpy.app.online_access
        row.operator(PrimrayInstall.bl_idname)
        if not bpy.app.online_access:
            self.layout.label(text="Allow Online Access in the system's preferences to install")


class PrimrayInstall(bpy.types.Operator):  # type: ignore[misc]
    bl_idname = "primray.install"
    bl_label = "Install primray"
    bl_description = "Make an environment of Python for this add-on and install primray into it"

    def execute(self, context: Any) -> set[str]:
        if not bpy.app.online_access:
            self.report({"ERROR"}, "Online access is not allowed in Blender's preferences")
            return {"CANCELLED"}
        try:
            processes.install(own_folder())
        except processes.ProcessError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


def preferred_python() -> str:
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences.python if addon is not None and addon.preferences is not None else ""


def own_folder() -> str:
    """Return the folder of the add-on's own environment, which upgrades of the extension keep."""
    return bpy.utils.extension_path_user(PACKAGE, path="environment")


def show_notes(notes: list[dict[str, str]]) -> None:
    NOTES[:] = notes


def show_end(end: dict[str, Any]) -> None:
    END.clear()
    END.update(end)


def end_in_words() -> str:
    """Return how the last render ended, for the panel and the status line; "" before the first one."""
    if not END:
        return ""
    least, most = END["samples"]
    words = [f"{least} samples" if least == most else f"{least} to {most} samples", str(END["stop"]).replace("-", " ")]
    return ", ".join(words + ([f"relMSE {END['relmse']:.2g}"] if END["relmse"] is not None else []))


def named(diagnostics: list[dict[str, str]], objects: dict[str, str]) -> list[dict[str, str]]:
    """Return primray's diagnostics with the objects that the prims were exported from."""
    rows = []
    for row in diagnostics:
        path = row["prim"] or ""
        while path and path not in objects:
            path = path.rpartition("/")[0]
        rows.append({"code": row["code"], "object": objects.get(path, row["prim"]), "message": row["message"]})
    return rows


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {"PRIMRAY"}  # noqa: RUF012 - Blender's way

    @classmethod
    def poll(cls, context: Any) -> bool:
        return bool(context.engine == "PRIMRAY")


class PRIMRAY_PT_sampling(_Panel, bpy.types.Panel):  # type: ignore[misc]
    bl_label = "Sampling"

    def draw(self, context: Any) -> None:
        self.layout.use_property_split = True
        for name in (
            "samples",
            "preview_samples",
            "target_error",
            "time_limit",
            "max_depth",
            "seed",
            "every_s",
            "denoise",
            "error_pass",
            "error_overlay",
        ):
            self.layout.prop(context.scene.primray, name)
        self.layout.operator("primray.save_stage")
        if END:
            self.layout.label(text=f"Last: {end_in_words()}")


class PRIMRAY_PT_notes(_Panel, bpy.types.Panel):  # type: ignore[misc]
    bl_label = "Not Rendered as in Blender"

    def draw(self, context: Any) -> None:
        if not NOTES:
            self.layout.label(text="Nothing known of the last render")
        for row in NOTES[:50]:
            self.layout.label(text=f"{row['object']}: {row['message']}", icon="INFO")
        if len(NOTES) > 50:
            self.layout.label(text=f"and {len(NOTES) - 50} more")


CLASSES = (PrimraySettings, PrimrayPreferences, PrimrayInstall, PRIMRAY_PT_sampling, PRIMRAY_PT_notes)
# Panels that other engines share, but that mean nothing here.
UNLIKE = ("eevee", "freestyle", "simplify", "gpencil", "grease")


def _shared_panels() -> list[Any]:
    return [
        panel
        for panel in bpy.types.Panel.__subclasses__()
        if "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ())
        and not any(word in panel.__name__.lower() for word in UNLIKE)
    ]


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.primray = bpy.props.PointerProperty(type=PrimraySettings)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add("PRIMRAY")


def unregister() -> None:
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard("PRIMRAY")
    del bpy.types.Scene.primray
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
