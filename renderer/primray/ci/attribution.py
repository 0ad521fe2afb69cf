"""Pictures of a stage before and after a change, and which of its edits moves which pixels.

Both sides have the same seed, so that what a change does not reach has the same bits. Each edit is made alone on the side
before: of a layer in a kept scene, of another file on disk. Pixels that change with none of them need several together.
"""

from __future__ import annotations

import gc
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..compare import compare
from ..compare.comparison import Comparison, Verdict
from ..errors import PrimrayError
from ..file_formats import is_pointer_file
from ..images.exposure import View, exposure_that_serves
from ..images.image import Image
from ..incremental.scene import Scene
from ..settings import RenderSettings
from ..usd import Edit, edits_between, made_alone, readable_layer, sampled_times, used_layer
from .changes import Change
from .repository import Sides
from .touched import Touched, absent_submodules

SEEN = 2  # steps of 255 on a display from which on a pixel counts as seen to differ
MOST_TIMES = 4
LAYERS = (".usd", ".usda", ".usdc")
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Effect:
    """What one edit, or a group of them, does by itself. Pixels are over all times; boxes exclude their ends."""

    name: str
    file: str
    values: tuple[str, str] | None  # before and after
    edits: int
    pixels: int = 0  # whose bits differ
    seen: int = 0  # whose displayed values differ
    box: tuple[int, int, int, int] | None = None
    masks: tuple[Mask, ...] = ()
    seen_masks: tuple[Mask, ...] = ()
    failed: str | None = None  # why it cannot be made alone


@dataclass(frozen=True)
class Shot:
    """One time of a stage: both pictures, and what compares them."""

    time: float | None
    before: Image
    after: Image
    comparison: Comparison
    pixels: int
    seen: int
    together: int = 0  # pixels that no edit changes alone


@dataclass(frozen=True)
class StageResult:
    """`verdict`: identical, unchanged (within noise), undecided, changed, new, deleted, broken, mended, or unrendered: neither
    side can be."""

    stage: str
    verdict: str
    words: str
    changes: tuple[Change, ...]
    shots: tuple[Shot, ...] = ()
    effects: tuple[Effect, ...] = ()
    diagnostics: tuple[dict[str, Any], ...] = ()  # that the side before does not have
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Asked:
    settings: RenderSettings
    tolerance: float = 0.01
    most_edits: int = 64
    times: tuple[float, ...] = ()


@dataclass
class _Group:
    file: str
    edits: list[Edit] = field(default_factory=list)
    change: Change | None = None  # of a whole file


def judged(touched: Touched, sides: Sides, asked: Asked) -> StageResult:
    """Render a stage on both sides and say what changed, and by which edits."""
    before, after = sides.before / touched.path, sides.after / touched.path
    absent = [path for path in touched.files for side in (sides.before, sides.after) if is_pointer_file(str(side / path))]
    changed = {path for change in touched.changes for path in change.paths}
    notes = tuple(f"{path} is a Git LFS pointer: fetch it (git lfs pull)" for path in sorted(set(absent)))
    missing = absent_submodules(touched, sides)
    notes += tuple(sides.submodules.absent[path] for path in missing)
    if any(path not in sides.submodules.alike for path in missing):
        return StageResult(touched.path, "undecided", "a submodule's files are missing", touched.changes, notes=notes)
    if not before.is_file() or not after.is_file():
        return replace(_one_sided(touched, before, after, asked), notes=notes)
    scene, first, fault = _opened(before, asked)
    other, last, later_fault = _opened(after, asked)
    try:
        if first is None or last is None or scene is None or other is None:
            verdict = "unrendered" if first is last else "broken" if last is None else "mended"
            words = {
                "unrendered": f"cannot be rendered on either side: {later_fault}",
                "broken": later_fault,
                "mended": f"could not be rendered before: {fault}",
            }
            return StageResult(touched.path, verdict, words[verdict], touched.changes, notes=notes)
        times, more = _times(touched, sides, scene, other, asked)
        notes += more
        pairs = [(_at(scene, time, asked), _at(other, time, asked)) for time in times]
        shots = [_shot(time, *pair, asked.tolerance) for time, pair in zip(times, pairs, strict=True)]
        verdict = _worst(shots)
        if verdict in ("identical", "unchanged") and changed & set(absent):
            return StageResult(touched.path, "undecided", "a changed file is a Git LFS pointer", touched.changes, notes=notes)
        told = _new_diagnostics(first, last)
        effects: list[Effect] = []
        if verdict != "identical":
            groups = _groups(touched, sides, asked.most_edits, scene)
            effects = _effects(groups, touched, sides, scene, times, shots, asked)
            shots = _with_remainders(shots, effects)
        return StageResult(touched.path, verdict, "", touched.changes, tuple(shots), tuple(effects), told, notes)
    finally:
        for each in (scene, other):
            if each is not None:
                each.close()


def _one_sided(touched: Touched, before: Path, after: Path, asked: Asked) -> StageResult:
    if not after.is_file():
        return StageResult(touched.path, "deleted", "the stage is gone", touched.changes)
    scene, picture, fault = _opened(after, asked)
    if scene is not None:
        scene.close()
    if picture is None:
        return StageResult(touched.path, "broken", fault, touched.changes)
    blank = replace(
        picture, pixels=np.zeros_like(picture.pixels), errors=None if picture.errors is None else picture.errors * 0
    )
    shot = _shot(None, blank, picture, asked.tolerance)
    return StageResult(
        touched.path, "new", "the stage is new", touched.changes, (shot,), diagnostics=_new_diagnostics(None, picture)
    )


def _opened(path: Path, asked: Asked) -> tuple[Scene | None, Image | None, str]:
    try:
        scene = Scene(str(path))
        return scene, _at(scene, None, asked), ""
    except PrimrayError as error:
        return None, None, str(error)


def _at(scene: Scene, time: float | None, asked: Asked) -> Image:
    settings = asked.settings if time is None else replace(asked.settings, time_code=time)
    return scene.render(settings, progress=False)


def _times(
    touched: Touched, sides: Sides, scene: Scene, other: Scene, asked: Asked
) -> tuple[list[float | None], tuple[str, ...]]:
    """Return the times to look at: those asked for, or the stage's own and those whose samples were edited."""
    if asked.times:
        return list(asked.times), ()
    names = set()
    for _, edits in _layer_edits(touched, sides):
        names |= {edit.path.rpartition(".")[2] for edit in edits if "." in edit.path.rpartition("/")[2]}
    edited = sorted(sampled_times(scene.stage, other.stage, frozenset(names))) if names else []
    chosen = edited
    if len(edited) > MOST_TIMES:
        chosen = [edited[k] for k in np.linspace(0, len(edited) - 1, MOST_TIMES).round().astype(int)]
    told = () if chosen == edited else (f"{len(edited)} times have other samples; {MOST_TIMES} of them are looked at",)
    return [None, *chosen], told


def _shot(time: float | None, before: Image, after: Image, tolerance: float) -> Shot:
    mask = _differs(before, after)
    return Shot(
        time, before, after, compare(before, after, tolerance=tolerance), int(mask.sum()), int(_seen(before, after).sum())
    )


def stops_of(before: Image, after: Image) -> float:
    """Return the exposure that serves the picture before, or the one after where nothing is lit before."""
    lit = before if before.pixels[..., :3].any() else after
    return exposure_that_serves(lit.pixels, View(space=lit.color_space))


def _differs(one: Image, other: Image) -> Mask:
    mask: Mask = (one.pixels.view(np.uint32) != other.pixels.view(np.uint32)).any(axis=2)
    return mask


def _seen(one: Image, other: Image) -> Mask:
    """Return the pixels that are seen to differ, both at one exposure, so that dark pictures are judged as they are shown."""
    stops = stops_of(one, other)
    shown = [image.to_uint8(exposure=stops).astype(int) for image in (one, other)]
    mask: Mask = (np.abs(shown[0] - shown[1]) >= SEEN).any(axis=2)
    return mask


def _worst(shots: Sequence[Shot]) -> str:
    if not any(shot.pixels for shot in shots):
        return "identical"
    found = {shot.comparison.verdict for shot in shots if shot.pixels}
    worst: Verdict = next(v for v in (Verdict.CHANGED, Verdict.UNDECIDED, Verdict.UNCHANGED) if v in found)
    return str(worst.value)


def _new_diagnostics(before: Image | None, after: Image) -> tuple[dict[str, Any], ...]:
    def rows(image: Image) -> list[dict[str, Any]]:
        return [
            {key: row.get(key) for key in ("severity", "code", "prim_path", "message")} for row in image.report["diagnostics"]
        ]

    known = [] if before is None else rows(before)
    return tuple(row for row in rows(after) if row not in known)


def _layer_edits(touched: Touched, sides: Sides) -> Iterator[tuple[Change, list[Edit]]]:
    """Yield the changed layers that both sides can read, under one name, with their edits."""
    for change in touched.changes:
        if change.before is None or change.before != change.after or not change.before.lower().endswith(LAYERS):
            continue
        try:
            old, new = (readable_layer(str(side / change.before)) for side in (sides.before, sides.after))
        except PrimrayError:
            continue
        yield change, edits_between(old, new)


def _groups(touched: Touched, sides: Sides, most: int, scene: Scene) -> list[_Group]:
    """Return edits to make alone: each, or those of each prim, or of each layer, where these would be too many."""
    by_layer = {
        change.before: edits
        for change, edits in _layer_edits(touched, sides)
        if change.before is not None and used_layer(scene.stage, str(sides.before / change.before)) is not None
    }
    whole = [_Group(change.name, change=change) for change in touched.changes if change.before not in by_layer]
    each = [_Group(file, [edit]) for file, edits in by_layer.items() for edit in edits]
    if len(each) > most:
        prims: dict[tuple[str, str], _Group] = {}
        for group in each:
            (edit,) = group.edits
            prims.setdefault((group.file, _prim_of(edit)), _Group(group.file)).edits.append(edit)
        each = list(prims.values())
    if len(each) > most:
        each = [_Group(file, edits) for file, edits in by_layer.items()]
    return [*each, *whole]


def _prim_of(edit: Edit) -> str:
    at, dot, name = edit.path.rpartition(".")
    return at if dot and "/" not in name else edit.path


def _effects(
    groups: list[_Group],
    touched: Touched,
    sides: Sides,
    scene: Scene,
    times: list[float | None],
    shots: list[Shot],
    asked: Asked,
) -> list[Effect]:
    pictures = [shot.before for shot in shots]
    found: list[Effect] = []
    for group in (each for each in groups if each.change is None):
        file = str(sides.before / group.file)
        layer = used_layer(scene.stage, file)
        assert layer is not None
        try:
            with made_alone(layer, readable_layer(str(sides.after / group.file)), group.edits):
                alone = [_at(scene, time, asked) for time in times]
            found.append(_measured(group, pictures, alone))
        except PrimrayError as error:
            found.append(replace(_nameless(group), failed=str(error)))
    for group in (each for each in groups if each.change is not None):
        assert group.change is not None
        try:
            with _with_file(sides, group.change) as folder:
                changed = Scene(str(folder / touched.path))
                try:
                    found.append(_measured(group, pictures, [_at(changed, time, asked) for time in times]))
                finally:
                    changed.close()
        except PrimrayError as error:
            found.append(replace(_nameless(group), failed=str(error)))
    return sorted(found, key=lambda effect: (-effect.seen, -effect.pixels))


@contextmanager
def _with_file(sides: Sides, change: Change) -> Iterator[Path]:
    """Yield a folder with the side before and one file as it is after; layers of another folder are other layers to USD."""
    folder = sides.before.parent / "alone"
    try:
        shutil.copytree(sides.before, folder, copy_function=_linked, symlinks=True, ignore=shutil.ignore_patterns(".git"))
        if change.before is not None:
            (folder / change.before).unlink(missing_ok=True)
        if change.after is not None:
            (folder / change.after).parent.mkdir(parents=True, exist_ok=True)
            (folder / change.after).unlink(missing_ok=True)
            shutil.copyfile(sides.after / change.after, folder / change.after, follow_symlinks=False)
        yield folder
    finally:
        gc.collect()  # the next file's layers have the same paths, and USD knows layers by them while anything holds them
        shutil.rmtree(folder, ignore_errors=True)


def _linked(source: str, target: str) -> str:
    os.link(source, target)
    return target


def _nameless(group: _Group) -> Effect:
    if group.change is not None:
        return Effect(group.change.name, group.file, None, 1)
    first = group.edits[0]
    if len(group.edits) == 1:
        return Effect(first.name, group.file, (first.before or "(none)", first.after or "(none)"), 1)
    prims = {_prim_of(edit) for edit in group.edits}
    return Effect(prims.pop() if len(prims) == 1 else group.file, group.file, None, len(group.edits))


def _box(mask: Mask) -> tuple[int, int, int, int] | None:
    ys, xs = np.nonzero(mask)
    return (int(xs.min()), int(ys.min()), int(xs.max()) + 1, int(ys.max()) + 1) if len(xs) else None


def _with_remainders(shots: list[Shot], effects: list[Effect]) -> list[Shot]:
    """Return the shots with what no edit does alone."""
    made = []
    for k, shot in enumerate(shots):
        alone = [effect.masks[k] for effect in effects if effect.masks]
        left = _differs(shot.before, shot.after) & ~np.logical_or.reduce([np.zeros(shot.before.pixels.shape[:2], bool), *alone])
        made.append(replace(shot, together=int(left.sum())))
    return made


def _measured(group: _Group, before: list[Image], alone: list[Image]) -> Effect:
    masks = tuple(_differs(a, b) for a, b in zip(before, alone, strict=True))
    seen = [_seen(a, b) for a, b in zip(before, alone, strict=True)]
    union = np.logical_or.reduce(seen if any(mask.any() for mask in seen) else masks)
    return replace(
        _nameless(group),
        pixels=sum(int(mask.sum()) for mask in masks),
        seen=sum(int(mask.sum()) for mask in seen),
        box=_box(union),
        masks=masks,
        seen_masks=tuple(seen),
    )
