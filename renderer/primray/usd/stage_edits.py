"""The first pass of a translation, the stage edits: copies of the stage in which what the traversal cannot do is done.

Those are, in this order: a render pass, geometry lights, back plates, poses of skeletons, levels of detail. Most stages need
none of them and are not copied.
"""

from __future__ import annotations

from functools import cached_property

from pxr import Usd

from ..diagnostics import Diagnostics
from ..settings import RenderSettings
from .camera.back_plates import RenderedCamera, find_back_plates, with_back_plates
from .camera.view import estimate_view, view_without_scene
from .lights.geometry_light import with_geometry_lights
from .motion.pixels import Foreseen
from .render_settings.render_pass import with_render_pass
from .scene.level_of_detail import with_levels_chosen
from .scene.prims_by_type import SearchedStage, find_by_type
from .skinning.baking import any_drawn, posed_stage
from .stage.edits import OpinionsLeak, isolated_copy
from .stage.values import when_of
from .view_setup import ViewSetup, set_up_view


class _ViewBeforeEdits:
    """The view of the stage before its edits, for those that depend on it; what it reports, the view afterwards reports too."""

    def __init__(self, searched: SearchedStage, settings: RenderSettings) -> None:
        self._searched, self._settings = searched, settings

    @cached_property
    def setup(self) -> ViewSetup:
        return set_up_view(self._searched, self._settings, Diagnostics(), {})

    @property
    def rendered_camera(self) -> RenderedCamera | None:
        """The camera of the stage that the picture is taken through, with its frame; None without one."""
        view = self.setup
        camera, frame = view_without_scene(view.camera, view.ctx, view.product, view.shutter)
        return None if view.camera is None or camera is None else RenderedCamera(view.camera, camera, frame)

    @property
    def foreseen(self) -> Foreseen:
        """How large things will appear."""
        return estimate_view(self.setup.camera, self.setup.ctx, self.setup.product)

    def camera_on(self, stage: Usd.Stage) -> Usd.Prim | None:
        """Return the camera's prim on a copy of the stage; None if the picture is not taken through a camera of the stage."""
        return None if self.setup.camera is None else stage.GetPrimAtPath(self.setup.camera.GetPath())


def edit_stage(stage: Usd.Stage, settings: RenderSettings, diagnostics: Diagnostics) -> SearchedStage:
    """Return the stage to traverse: the stage itself, or an edited copy.

    Where an edit would change prims that it is not meant for, an isolated copy is edited instead.
    """
    count = len(diagnostics)
    try:
        return _edited(stage, settings, diagnostics)
    except OpinionsLeak:
        diagnostics.forget_after(count)
    # Not while that is handled: what USD prints of an error in its callbacks would show it as the cause.
    return _edited(isolated_copy(stage), settings, diagnostics)


def _edited(stage: Usd.Stage, settings: RenderSettings, diagnostics: Diagnostics) -> SearchedStage:
    """Return the stage after its edits; raise OpinionsLeak if one would change prims that it is not meant for."""
    if settings.render_pass is not None:
        stage = with_render_pass(stage, settings.render_pass, diagnostics)
    when = when_of(stage, settings.time_code)
    searched = SearchedStage(stage, find_by_type(stage, diagnostics, settings.render_pass), when)
    view, found = _ViewBeforeEdits(searched, settings), searched.found
    if found.geometry_lights:
        stage = with_geometry_lights(stage, found.geometry_lights, view.setup.ctx.purposes, when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if plates := find_back_plates(found.cameras):
        stage = with_back_plates(stage, plates, view.rendered_camera, when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if any_drawn(stage, found.skeletons):
        stage = posed_stage(stage, when, view.foreseen, diagnostics)
        found = find_by_type(stage, Diagnostics())
    if found.has_levels:
        stage = with_levels_chosen(stage, view.camera_on(stage), when, diagnostics)
        found = find_by_type(stage, Diagnostics())
    return SearchedStage(stage, found, when)


def may_be_edited(searched: SearchedStage) -> bool:
    """Return whether a stage has prims of which some edit may be needed, render passes aside."""
    found = searched.found
    return bool(found.skeletons or found.geometry_lights or found.has_levels or find_back_plates(found.cameras))
