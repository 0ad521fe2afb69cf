"""Incremental translation of a stage: only what edits affect is translated again, and the result is that of a new
translation."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from pxr import Sdf, Usd

from ...description import SceneDescription, TextureFile, TextureInput
from ...description.shading import pattern_files
from ...diagnostics import Diagnostic, Diagnostics
from ...errors import PrimrayError
from ...process_memory import without_collection
from ...settings import RenderSettings
from ..mesh.triangulate import Triangulator, triangulated
from ..scene.context import Context
from ..scene.translated_scene import Record, TranslatedScene
from ..stage.messages import file_names
from ..stage.open import usd_messages
from ..stage.time_varying import changing, has_clips, has_time_values
from ..stage.traversal import populated
from ..stage.values import When, when_of
from ..translate import Assembled, assemble, finish, may_be_edited, translate, with_names
from ..view_setup import Found, SearchedStage, ViewSetup, find_by_type, set_up_view
from .updates import Changes, LeafUpdates, MaterialUpdates, UnknownEffect, affected_by, moved_leaves

# Codes of messages from USD, whose subject is not known by a prim path.
_CODES_WITHOUT_PRIM = frozenset({"usd-message", "wrong-type"})


@dataclass(kw_only=True)
class Translated:
    """A translation with all that it was made from, kept up to date."""

    settings: RenderSettings
    found: Found
    when: When
    begun: ViewSetup
    assembled: Assembled  # before anything that only a view decides
    names: dict[str, str]
    found_diagnostics: list[Diagnostic]
    assembly_diagnostics: list[Diagnostic]
    leaf_diagnostics: list[Diagnostic]  # the last of assembled_told
    later_diagnostics: list[Diagnostic]
    description: SceneDescription
    diagnostics: Diagnostics
    materials: MaterialUpdates = field(default_factory=MaterialUpdates)
    changing: set[Sdf.Path] | None = None  # attributes that vary over time; None: not known yet

    @property
    def record(self) -> Record:
        return self.assembled.scene.record


class KeptTranslation:
    """Translation of one stage that survives edits. Some kinds of edits are understood; after any other everything is
    redone."""

    def __init__(self, triangulator: Triangulator = triangulated) -> None:
        self._made: Translated | None = None
        self._triangulator = triangulator

    def translate(self, stage: Usd.Stage, settings: RenderSettings, changes: Changes) -> tuple[SceneDescription, Diagnostics]:
        """Return the translation; unchanged parts of the description are the same objects as before, and so is a whole one."""
        made, self._made = self._made, None  # nothing is kept if this fails
        if made is not None and not changes and settings == made.settings:
            self._made = made
            return made.description, made.diagnostics
        if made is not None and not changes.others:
            made = _updated(made, stage, settings, changes, self._triangulator)
            if made is not None:
                self._made = made
                return made.description, made.diagnostics
        self._made = _translated_recorded(stage, settings, self._triangulator)
        if self._made is None:
            return translate(stage, settings, self._triangulator)
        return self._made.description, self._made.diagnostics

    def forget(self) -> None:
        self._made = None

    def files(self, description: SceneDescription) -> Iterator[str]:
        """Yield all files of the description that are not layers, and folders where further tiles of it would be."""
        for file in _texture_files(description):
            if not file.tiles:
                yield file.path
            for _, path in file.tiles:
                yield path
                yield os.path.dirname(path)
        if self._made is not None:
            yield from self._made.assembled.ctx.caches.ies_files
            yield from self._made.assembled.ctx.caches.volume_files


def _texture_files(description: SceneDescription) -> Iterator[TextureFile]:
    yield from (light.texture for light in description.lights if light.texture is not None)
    for surface in description.surfaces:
        yield from (reads.file for _, reads in surface.inputs if isinstance(reads, TextureInput))
        yield from pattern_files(surface.pattern) if surface.pattern is not None else ()


def _translated_recorded(stage: Usd.Stage, settings: RenderSettings, triangulator: Triangulator) -> Translated | None:
    """Return a complete, recorded translation; None for stages of which no part could be kept."""
    if settings.render_pass is not None:
        return None
    diagnostics, names = Diagnostics(file_names(stage).in_text), dict[str, str]()
    with usd_messages(diagnostics), without_collection():
        searched = SearchedStage(stage, find_by_type(stage, diagnostics), when_of(stage, settings.time_code))
        if may_be_edited(searched):
            return None
        counts = [len(diagnostics)]
        begun = set_up_view(searched, settings, diagnostics, names, triangulator)
        counts.append(len(diagnostics))
        assembled = assemble(begun.ctx, Record(is_on=True))
        counts += [assembled.scene.record.told, len(diagnostics)]
        description = finish(begun, replace(assembled, scene=_copied(assembled.scene)))
        counts.append(len(diagnostics))
    told = list(diagnostics)
    first, began, walked, built, seen = counts
    return Translated(
        settings=settings,
        found=searched.found,
        when=searched.when,
        begun=begun,
        assembled=assembled,
        names=names,
        found_diagnostics=told[:first],
        assembly_diagnostics=told[began:built],
        leaf_diagnostics=told[walked:built],
        later_diagnostics=told[seen:],
        description=description,
        diagnostics=with_names(diagnostics, names),
    )


def _copied(scene: TranslatedScene) -> TranslatedScene:
    """Return the scene with copies of its lists."""
    return replace(
        scene,
        shapes=list(scene.shapes),
        static=list(scene.static),
        prototypes=list(scene.prototypes),
        placements=list(scene.placements),
        lights=list(scene.lights),
    )


def _updated(
    made: Translated, stage: Usd.Stage, settings: RenderSettings, changes: Changes, triangulator: Triangulator
) -> Translated | None:
    """Return the translation with what has changed redone; None where that is not known. `made` is invalid afterwards."""
    try:
        if _survives_no_edit(made, settings):
            raise UnknownEffect
        when = _when(made, stage, settings, changes)
        return _patched(made, stage, settings, when, _edited(made, stage, settings, changes), triangulator)
    except (UnknownEffect, PrimrayError):  # a complete translation reports the same
        return None


def _survives_no_edit(made: Translated, settings: RenderSettings) -> bool:
    timing = made.begun.ctx.timing
    return (
        timing.is_open
        or not timing.is_frame
        or not made.record.is_plain
        or bool(made.when.at_knots)
        or settings.max_memory_bytes != made.settings.max_memory_bytes
        or any(d.code in _CODES_WITHOUT_PRIM for d in made.diagnostics)
    )


def _when(made: Translated, stage: Usd.Stage, settings: RenderSettings, changes: Changes) -> When:
    """Return the time to read at as `when_of` does, without looking at the whole stage."""
    if settings.time_code is not None:
        return When(Usd.TimeCode(settings.time_code), careful=False)
    if made.settings.time_code is not None:
        raise UnknownEffect
    if not made.when.careful and any(has_time_values(stage.GetAttributeAtPath(path)) for path in changes.values):
        raise UnknownEffect
    return When(Usd.TimeCode.Default(), careful=made.when.careful)


def _edited(made: Translated, stage: Usd.Stage, settings: RenderSettings, changes: Changes) -> set[Sdf.Path]:
    """Return attributes whose values may differ: the edited ones and, at another time, those that vary over time."""
    paths = set(changes.values)
    if made.changing is not None:
        made.changing |= {path for path in paths if has_time_values(stage.GetAttributeAtPath(path))}
    if settings.time_code == made.settings.time_code:
        return paths
    if made.settings.time_code is None:
        raise UnknownEffect
    if made.changing is None:
        prims = list(populated(stage))
        if any(map(has_clips, prims)):
            raise UnknownEffect
        made.changing = changing(prims)
    return paths | made.changing


def _walked_by(ctx: Context) -> tuple[object, ...]:
    """Return the context's fields that the walk and the adapters depend on, besides the stage."""
    return (
        ctx.purposes,
        ctx.material_purposes,
        ctx.timing,
        ctx.rendering_space,
        ctx.aov_primvars,
        ctx.names_instances,
        ctx.primvars_read,
        ctx.color_primvars,
    )


def _patched(
    made: Translated,
    stage: Usd.Stage,
    settings: RenderSettings,
    when: When,
    edited: set[Sdf.Path],
    triangulator: Triangulator,
) -> Translated:
    diagnostics = Diagnostics(file_names(stage).in_text)
    with usd_messages(diagnostics), without_collection():
        diagnostics.extend(made.found_diagnostics)
        searched = SearchedStage(stage, made.found, when)
        begun = set_up_view(searched, settings, diagnostics, made.names, triangulator)
        if _walked_by(begun.ctx) != _walked_by(made.begun.ctx):
            raise UnknownEffect
        assembled = _updated_assembly(made, begun, edited)
        diagnostics.extend(made.assembly_diagnostics)
        description = finish(begun, replace(assembled, scene=_copied(assembled.scene)))
        count = len(diagnostics)
    if len(diagnostics) > count or any(d.code in _CODES_WITHOUT_PRIM for d in diagnostics):
        raise UnknownEffect
    diagnostics.extend(made.later_diagnostics)
    told = with_names(diagnostics, made.names)
    return replace(
        made, settings=settings, when=when, begun=begun, assembled=assembled, description=description, diagnostics=told
    )


def _updated_assembly(made: Translated, begun: ViewSetup, edited: set[Sdf.Path]) -> Assembled:
    before, record = made.assembled, made.record
    old = before.ctx
    ctx = replace(begun.ctx, caches=old.caches, findings=old.findings, surfaces=old.surfaces, shares=old.shares)
    touched = affected_by(edited, ctx.stage, record)
    ctx.caches.source_geometries.clear()  # an edit may be of one
    if touched.shading:
        ctx = replace(ctx, surfaces=made.materials.surfaces(touched.shading, ctx))
    scene = _copied(before.scene)
    again = LeafUpdates(scene, ctx, made.leaf_diagnostics)
    moved = moved_leaves(touched.moved, record, ctx)
    for become, matrix in moved:
        again.stand(become, matrix)
    lit = {become.leaf.path for become, _ in moved}
    for path in sorted(touched.leaves):
        become = record.leaves[path]
        if become.leaf.type_name not in scene.adapters.lights:
            again.shape(become)
        elif path not in lit:
            again.light(become, become.leaf.poses.of([become.leaf.pose])[0])
    return replace(before, ctx=ctx, scene=scene)
