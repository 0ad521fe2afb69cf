"""One search of a stage and its native prototypes for the prims that are needed by type, wherever they are."""

from __future__ import annotations

from dataclasses import dataclass, field

from pxr import Usd

from ...diagnostics import Diagnostics
from ..camera.view import cameras_in_instances
from ..render_settings.render_pass import report_ignored_render_pass
from ..stage.reads import has_schema, type_name
from ..stage.traversal import exists, is_in_world, populated, prims_in_instances
from ..stage.values import When
from .level_of_detail import LOD_ROOT

# Types below which nothing is drawn: none of them is asked for levels of detail.
_NEVER_DRAWN = frozenset({"Shader", "NodeGraph", "Material", "GeomSubset"})
_TYPES = frozenset({"Camera", "RenderSettings", "RenderPass", "Shader", "SkelRoot", "GeometryLight"})


@dataclass
class Found:
    """Prims of some types; cameras and settings are those in the world."""

    cameras: list[Usd.Prim] = field(default_factory=list)  # in the order of cameras_of
    in_prototypes: bool = False  # some cameras are in native prototypes
    lights_in_prototypes: bool = False  # some geometry lights are
    has_levels: bool = False  # there are roots of levels of detail
    settings: list[Usd.Prim] = field(default_factory=list)
    geometry_lights: list[Usd.Prim] = field(default_factory=list)  # in the world
    shaders: list[Usd.Prim] = field(default_factory=list)  # including those in native prototypes
    skeletons: list[Usd.Prim] = field(default_factory=list)  # SkelRoots, including those in native prototypes


@dataclass(frozen=True)
class SearchedStage:
    """A stage, the prims found on it, and the time to read it at."""

    stage: Usd.Stage
    found: Found
    when: When


def find_by_type(stage: Usd.Stage, diagnostics: Diagnostics, render_pass: str | None = None) -> Found:
    """Return the prims of these types. `render_pass` is the pass that is rendered; others are reported."""
    found = Found()
    for prim in populated(stage):
        name = type_name(prim)
        if name in _TYPES and exists(prim):
            _add(found, prim, str(name), diagnostics, render_pass)
        if not found.has_levels and name not in _NEVER_DRAWN and has_schema(prim, LOD_ROOT):
            found.has_levels = True
    if found.in_prototypes:
        found.cameras += cameras_in_instances(stage)
    if found.lights_in_prototypes:
        found.geometry_lights += prims_in_instances(stage, "GeometryLight")
    return found


def _add(found: Found, prim: Usd.Prim, name: str, diagnostics: Diagnostics, render_pass: str | None) -> None:
    if name == "Shader":
        found.shaders.append(prim)
    elif name == "SkelRoot":
        found.skeletons.append(prim)
    elif prim.IsInPrototype() or not is_in_world(prim):
        found.in_prototypes |= name == "Camera"
        found.lights_in_prototypes |= name == "GeometryLight"
    elif name == "Camera":
        found.cameras.append(prim)
    elif name == "RenderSettings":
        found.settings.append(prim)
    elif name == "GeometryLight":
        found.geometry_lights.append(prim)
    elif render_pass is None:
        report_ignored_render_pass(prim, diagnostics)
