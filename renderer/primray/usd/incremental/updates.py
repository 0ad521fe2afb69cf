"""Edits of a stage and what they affect, and updates of a translation after them.

Edits are collected from USD's notices until the next translation takes them. Leaves that moved are placed again; shapes, lights
and materials that changed are translated again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from pxr import Sdf, Tf, Usd

from ...arrays import Doubles
from ...description import Light, Placed, Surface
from ...diagnostics import Diagnostic, Diagnostics
from ..camera.session_camera import PLACEMENT, is_of_session_camera
from ..lights.assembly import add_lights
from ..materials.material import translate_uncached
from ..materials.translated_material import Material
from ..scene.assembly import linked, shape_of
from ..scene.context import Context, Findings, MaterialKey, SurfaceTable, TranslationCaches
from ..scene.inheritance import local_matrix, transforms
from ..scene.translated_scene import Record, TranslatedLeaf, TranslatedScene
from ..shapes.draw_mode import DRAW_MODES
from ..stage.reads import authored_attributes, connections, property_names, type_name
from ..stage.traversal import all_prims_in_instances

VALUES = frozenset({"default", "timeSamples"})  # the fields of an attribute that are its value


@dataclass
class Changes:
    """Paths of attributes of which only values have changed; `others`: anything else has, so that everything may differ."""

    values: dict[Sdf.Path, None] = field(default_factory=dict)  # in order
    others: bool = False

    def add(self, later: Changes) -> None:
        self.values |= later.values
        self.others |= later.others

    def __bool__(self) -> bool:
        return self.others or bool(self.values)


class StageChanges:
    """Changes of one stage since they were last taken. Notices arrive in whichever thread edits the stage."""

    def __init__(self, stage: Usd.Stage) -> None:
        self._heard = heard = _Heard()
        self._listening = Tf.Notice.Register(Usd.Notice.ObjectsChanged, lambda notice, _: heard.hear(notice), stage)

    def take(self) -> Changes:
        """Return all changes so far, and begin with none."""
        return self._heard.take()

    def are_there(self) -> bool:
        """Return whether there are any beside those of the session camera."""
        return self._heard.is_any()


class _Heard:
    """Collected changes, separate from StageChanges, which the registered listener would otherwise keep alive."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._changes = Changes()

    def take(self) -> Changes:
        with self._lock:
            taken, self._changes = self._changes, Changes()
        return taken

    def is_any(self) -> bool:
        with self._lock:
            return self._changes.others or not all(map(is_of_session_camera, self._changes.values))

    def hear(self, notice: Any) -> None:
        told = _changes_in(notice)
        with self._lock:
            self._changes.add(told)


def _changes_in(notice: Any) -> Changes:
    made = [*notice.GetResyncedPaths(), *notice.GetResolvedAssetPathsResyncedPaths()]
    if not all(map(is_of_session_camera, made)):
        return Changes(others=True)
    values: dict[Sdf.Path, None] = {PLACEMENT: None} if made else {}
    for path in notice.GetChangedInfoOnlyPaths():
        if is_of_session_camera(path):  # whatever it is: nothing but the camera depends on it
            values[PLACEMENT] = None
            continue
        fields = notice.GetChangedFields(path)
        if not path.IsPrimPropertyPath() or not fields or not VALUES.issuperset(fields):
            return Changes(others=True)
        values[path] = None
    return Changes(values)


# Types that are read again for every picture, and affect nothing else.
_LOOKED_UP = frozenset({"Camera", "RenderSettings", "RenderProduct", "RenderVar"})
_SHADING = frozenset({"Shader", "NodeGraph", "Material"})
# Attributes that are inherited, or that decide which prims are drawn.
_INHERITED = ("primvars:", "motion:", "material:", "collection:", "model:", "xformOp", "colorSpace", "skel:")
_DECIDING = frozenset({"visibility", "purpose", "guideVisibility", "proxyVisibility", "renderVisibility", "proxyPrim"})


@dataclass
class Affected:
    """Paths of prims whose transforms have changed, of leaves with other values, and of shading prims with other values."""

    moved: set[str] = field(default_factory=set)
    leaves: set[str] = field(default_factory=set)
    shading: set[Sdf.Path] = field(default_factory=set)


def affected_by(paths: Iterable[Sdf.Path], stage: Usd.Stage, record: Record) -> Affected:
    """Return what these attributes affect; raise NotKnownError where one of them may affect anything."""
    found = Affected()
    for path in paths:
        if is_of_session_camera(path):
            continue
        prim, name = stage.GetPrimAtPath(path.GetPrimPath()), path.name
        kind, at = type_name(prim) if prim else "", str(path.GetPrimPath())
        if name.startswith("xformOp:"):
            found.moved.add(at)
        elif kind in _SHADING and name.startswith("inputs:"):
            found.shading.add(path.GetPrimPath())
        elif name in _DECIDING or name.startswith(_INHERITED) or kind in _SHADING:
            raise UnknownEffect
        elif at in record.leaves:
            found.leaves.add(at)
        elif kind not in _LOOKED_UP:
            raise UnknownEffect
    return found


class UnknownEffect(Exception):
    """Raised where the effect of an edit is not known, so that everything is translated again; never shown to users."""


T = TypeVar("T")


@dataclass(frozen=True)
class LeafUpdates:
    """Translator of single leaves. `scene` is changed in place; `told` are the diagnostics of the leaves' first translation."""

    scene: TranslatedScene
    ctx: Context
    told: list[Diagnostic]

    def stand(self, become: TranslatedLeaf, matrix: Doubles) -> None:
        """Replace a leaf's transform."""
        if become.leaf.type_name in self.scene.adapters.lights:
            self.light(become, matrix)
        elif become.shape is not None:
            placed = self.scene.static[become.shape]
            if placed.shape != become.shape:
                raise UnknownEffect
            self.scene.static[become.shape] = Placed(placed.shape, matrix, placed.instance)

    def light(self, become: TranslatedLeaf, matrix: Doubles) -> None:
        if become.light is None or self.ctx.findings.portals or self.scene.lights[become.light].portals:
            raise UnknownEffect
        leaf, apart = become.leaf, TranslatedScene(self.scene.adapters, self.scene.links, Record())

        def make(ctx: Context) -> None:
            add_lights(apart, leaf, matrix, [()], 1, leaf.inherited.blur_scale, ctx)

        self._as_before(leaf.path, make)
        made: list[Light] = apart.lights
        if len(made) != 1 or made[0].portals:
            raise UnknownEffect
        self.scene.lights[become.light] = made[0]

    def shape(self, become: TranslatedLeaf) -> None:
        if become.shape is None or become.leaf.type_name in DRAW_MODES or self.ctx.findings.light_shapes:
            raise UnknownEffect
        before, surfaces = self.scene.shapes[become.shape], len(list(self.ctx.surfaces))
        made = self._as_before(become.leaf.path, lambda ctx: shape_of(become.leaf, ctx, self.scene))
        if made is None or not np.array_equal(made.surface, before.surface) or len(list(self.ctx.surfaces)) != surfaces:
            raise UnknownEffect
        self.scene.shapes[become.shape] = linked(made, become.leaf, self.scene)

    def _as_before(self, path: str, make: Callable[[Context], T]) -> T:
        """Return the translated object, if its diagnostics are those of before; else raise NotKnownError."""
        apart = Diagnostics(self.ctx.diagnostics.shown)
        known, found = self.ctx.caches, self.ctx.findings
        caches = TranslationCaches(materials=known.materials, ies_files=known.ies_files, faces=known.faces)
        findings = Findings(light_shapes=found.light_shapes, physical_schemas=found.physical_schemas)
        made = make(replace(self.ctx, diagnostics=apart, caches=caches, findings=findings))
        if list(apart) != [d for d in self.told if d.prim_path == path]:
            raise UnknownEffect
        return made


@dataclass
class MaterialUpdates:
    """Translator of materials of one translation; new surfaces replace those of before where nothing else depends on it."""

    beyond: list[MaterialKey] | None = None  # materials connected to prims that are not below them; None: not known yet

    def surfaces(self, edited: set[Sdf.Path], ctx: Context) -> SurfaceTable:
        """Return the table of surfaces with the materials that read these prims translated again; update their cache."""
        known = ctx.caches.materials
        ctx.caches.shader_ids.clear()  # an edit may be of one
        if ctx.findings.light_shapes:
            raise UnknownEffect
        if self.beyond is None:
            self.beyond = [key for key in known if _reads_beyond(ctx.stage.GetPrimAtPath(key[0]))]
        above = {prefix for path in edited for prefix in path.GetPrefixes()}
        keys = [key for key in known if key[0] in above or key in self.beyond]
        found = list(ctx.surfaces)
        for key in keys:
            made, told = translate_uncached(key, ctx)
            if told != known[key][1]:
                raise UnknownEffect
            found = _replaced(found, known[key][0], made)
            known[key] = made, told
        if len(set(found)) != len(found):
            raise UnknownEffect
        table = SurfaceTable()
        for surface in found:
            table.index_of(surface)
        return table


def _reads_beyond(material: Usd.Prim) -> bool:
    if not material or material.IsInPrototype():
        return True
    below = material.GetPath()
    return any(not path.HasPrefix(below) for path in _connected(material))


def _connected(material: Usd.Prim) -> Iterator[Sdf.Path]:
    for prim in all_prims_in_instances(material):
        for attribute in authored_attributes(prim):
            yield from connections(attribute)


def _replaced(surfaces: list[Surface], before: Material, now: Material) -> list[Surface]:
    """Return the surfaces with the old material's replaced by the new one, thin and solid: shapes choose between these."""
    old, new = before.surface, now.surface
    if old == new and before.hidden == now.hidden:
        return surfaces
    if old is None or new is None or before.hidden or now.hidden or old.inputs != new.inputs or _asks(old) != _asks(new):
        raise UnknownEffect
    found = []
    for surface in surfaces:
        if surface.path == old.path:
            if replace(surface, thin=old.thin) != old:
                raise UnknownEffect
            surface = replace(new, thin=surface.thin)
        found.append(surface)
    return found


def _asks(surface: Surface) -> tuple[bool, bool, bool, float]:
    """Return the properties that decide whether a shape's surface is thin, and which parts of it are holes."""
    return surface.transmits, surface.bends_nothing, surface.thin, surface.opacity_threshold


def moved_leaves(paths: Iterable[str], record: Record, ctx: Context) -> list[tuple[TranslatedLeaf, Doubles]]:
    """Return leaves whose matrices (4, 4) have changed, with the new ones; the record's poses are updated."""
    paths = list(paths)
    if not paths or not record.poses:
        return []
    poses = next(iter(record.poses.values()))[0]
    if any(other is not poses for other, _ in (*record.poses.values(), *record.used)):
        raise UnknownEffect
    before = poses.every().copy()
    cache = transforms(ctx.when)
    for path in paths:
        if path not in record.poses:
            raise UnknownEffect
        prim = ctx.stage.GetPrimAtPath(path)
        local, _ = local_matrix(prim, frozenset(property_names(prim)), ctx.when, cache)
        poses.put(record.poses[path][1], local)
    after = poses.every()
    if not np.isfinite(after).all() or not np.isfinite(before).all():
        raise UnknownEffect
    is_moved = (before.view(np.uint64) != after.view(np.uint64)).any(axis=(1, 2))
    if any(is_moved[pose] for _, pose in record.used):
        raise UnknownEffect
    found = [become for become in record.leaves.values() if is_moved[become.leaf.pose]]
    return list(zip(found, poses.of([become.leaf.pose for become in found]), strict=True)) if found else []
