"""Prims that are needed by type, wherever they are: one pass over the stage and its native prototypes.

Cameras, geometry lights and render passes count in the world only, all but passes also inside native instances, as proxies;
shaders and skeletons may also be reached by relationships below `class` and `over`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from pxr import Usd

from ...diagnostics import Diagnostics
from ..adapters.rendering.render_pass import note_render_pass
from ..querying.cameras import cameras_in_instances
from ..querying.guarded import type_name
from ..querying.traversal import in_instances, is_there, populated, stands_in_world

_TYPES = frozenset({"Camera", "RenderSettings", "RenderPass", "Shader", "SkelRoot", "GeometryLight"})


@dataclass
class Found:
    """Prims of some types; cameras and settings are those in the world."""

    cameras: list[Usd.Prim] = field(default_factory=list)  # in the order of querying.cameras
    in_prototypes: bool = False  # some cameras are in native prototypes
    lights_in_prototypes: bool = False  # some geometry lights are
    settings: list[Usd.Prim] = field(default_factory=list)
    geometry_lights: list[Usd.Prim] = field(default_factory=list)  # in the world
    shaders: list[Usd.Prim] = field(default_factory=list)  # including those in native prototypes
    skeletons: list[Usd.Prim] = field(default_factory=list)  # SkelRoots, including those in native prototypes


def find_by_type(stage: Usd.Stage, diagnostics: Diagnostics, render_pass: str | None = None) -> Found:
    """Return the prims of these types. `render_pass` is the pass that is rendered; others are reported."""
    found = Found()
    for prim in populated(stage):
        name = type_name(prim)
        if name in _TYPES and is_there(prim):
            _add(found, prim, str(name), diagnostics, render_pass)
    if found.in_prototypes:
        found.cameras += cameras_in_instances(stage)
    if found.lights_in_prototypes:
        found.geometry_lights += in_instances(stage, "GeometryLight")
    return found


def _add(found: Found, prim: Usd.Prim, name: str, diagnostics: Diagnostics, render_pass: str | None) -> None:
    if name == "Shader":
        found.shaders.append(prim)
    elif name == "SkelRoot":
        found.skeletons.append(prim)
    elif prim.IsInPrototype() or not stands_in_world(prim):
        found.in_prototypes |= name == "Camera"
        found.lights_in_prototypes |= name == "GeometryLight"
    elif name == "Camera":
        found.cameras.append(prim)
    elif name == "RenderSettings":
        found.settings.append(prim)
    elif name == "GeometryLight":
        found.geometry_lights.append(prim)
    elif render_pass is None:
        note_render_pass(prim, diagnostics)
