"""What differs between two states of a layer, spec by spec, and each of these edits made alone in the earlier state."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Tf, Usd

from ...errors import StageOpenError
from ..stage.layer_copy import readable_layer, restored
from ..stage.messages import check_is_text
from ..stage.metadata import spec_field
from ..stage.reads import authored_attributes, value_at
from ..stage.time_varying import layer_times, sample_times
from ..stage.traversal import all_prims_in_instances, specs_in
from .dependencies import _file

_LONGEST = 80  # letters of a value that is told


@dataclass(frozen=True)
class Edit:
    """One edit of a layer. `path`: of the spec; `field`: its field, or "" where the whole spec comes or goes.

    >>> Edit("/W/sphere.radius", "default", "1", "2").name
    '/W/sphere.radius'
    """

    path: str
    field: str
    before: str | None  # None: it is not there
    after: str | None

    @property
    def name(self) -> str:
        return self.path if self.field in ("", "default") else f"{self.path} [{self.field}]"


def edits_between(before: Sdf.Layer, after: Sdf.Layer) -> list[Edit]:
    """Return what `after` has otherwise than `before`: the topmost specs that came or went, and fields of those in both."""
    olds, news = _specs(before), _specs(after)
    found: list[Edit] = []
    for path in sorted(olds ^ news):
        if _owner(path) in olds ^ news:
            continue  # it came or went with what holds it
        is_new = path in news
        told = _told((after if is_new else before).GetObjectAtPath(path))
        found.append(Edit(str(path), "", None if is_new else told, told if is_new else None))
    for path in sorted(olds & news):
        old, new = before.GetObjectAtPath(path), after.GetObjectAtPath(path)
        fields = {*old.ListInfoKeys(), *new.ListInfoKeys()}
        if not _same(spec_field(old, "subLayers"), spec_field(new, "subLayers")):
            fields.discard("subLayerOffsets")  # part of that edit
        for field in sorted(fields):
            one, other = spec_field(old, field), spec_field(new, field)
            if not _same(one, other):
                found.append(Edit(str(path), field, _shown(one), _shown(other)))
    return found


def _specs(layer: Sdf.Layer) -> set[Sdf.Path]:
    """Return the paths of the specs that can be set; targets of relationships and connections are fields of these."""
    return {path for path in specs_in(layer) if not (path.IsTargetPath() or path.IsMapperPath() or path.IsExpressionPath())}


def _owner(path: Sdf.Path) -> Sdf.Path:
    return path.GetParentPath()


def _same(one: Any, other: Any) -> bool:
    return type(one) is type(other) and bool(one == other)


def _told(spec: Sdf.Spec) -> str:
    """Return the value of an attribute, or else what a spec is."""
    value = _shown(spec.default) if isinstance(spec, Sdf.AttributeSpec) else None
    return value or getattr(spec, "typeName", "") or "there"


def _shown(value: Any) -> str | None:
    if value is None:
        return None
    text = f"{value:.7g}" if isinstance(value, float) else " ".join(str(value).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


@contextmanager
def made_alone(layer: Sdf.Layer, after: Sdf.Layer, edits: Sequence[Edit]) -> Iterator[None]:
    """Make some of the edits in a layer that a stage uses, in memory; take them back at the end."""
    with restored(layer):
        with Sdf.ChangeBlock():
            for edit in edits:
                _make(layer, after, edit)
        yield


def _make(layer: Sdf.Layer, after: Sdf.Layer, edit: Edit) -> None:
    path = Sdf.Path(edit.path)
    if edit.field:
        if edit.field in ("subLayers", "subLayerOffsets"):
            _take_sublayers(layer, after)
            return
        if edit.field == "timeSamples":
            _take_samples(layer, after, path)
            return
        spec, source = layer.GetObjectAtPath(path), after.GetObjectAtPath(path)
        try:
            if edit.after is None:
                spec.ClearInfo(edit.field)
            else:
                spec.SetInfo(edit.field, spec_field(source, edit.field))
        except (Tf.ErrorException, TypeError):  # a type or a variability: they are read-only, so the whole spec is taken over
            Sdf.CopySpec(after, path, layer, path)
    elif edit.after is not None:
        Sdf.CopySpec(after, path, layer, path)
    else:
        _remove(layer, path)


def _take_samples(layer: Sdf.Layer, after: Sdf.Layer, path: Sdf.Path) -> None:
    for time in layer_times(layer, path):
        layer.EraseTimeSample(path, time)
    for time in layer_times(after, path):
        layer.SetTimeSample(path, time, after.QueryTimeSample(path, time))


def _take_sublayers(layer: Sdf.Layer, after: Sdf.Layer) -> None:
    layer.subLayerPaths = list(after.subLayerPaths)
    for k, offset in enumerate(after.subLayerOffsets):
        layer.subLayerOffsets[k] = offset


def _remove(layer: Sdf.Layer, path: Sdf.Path) -> None:
    edits = Sdf.BatchNamespaceEdit()
    edits.Add(path, Sdf.Path.emptyPath)
    if not layer.Apply(edits):  # variants cannot be named by namespace edits
        owner = layer.GetObjectAtPath(path.GetParentPath())
        if isinstance(owner, Sdf.VariantSetSpec):
            owner.RemoveVariant(layer.GetObjectAtPath(path))


def used_layer(stage: Usd.Stage, file: str) -> Sdf.Layer | None:
    """Return the layer with which a stage reads a file; None where it reads the file in another way."""
    wanted = os.path.realpath(file)
    return next((each for each in stage.GetUsedLayers() if each.realPath and os.path.realpath(each.realPath) == wanted), None)


def sampled_times(before: Usd.Stage, after: Usd.Stage, names: frozenset[str]) -> set[float]:
    """Return the stage times of samples that differ between two stages, of attributes with these names."""
    found: set[float] = set()
    for prim in all_prims_in_instances(after.GetPseudoRoot()):
        other = before.GetPrimAtPath(prim.GetPath())
        for attribute in authored_attributes(prim):
            if attribute.GetName() not in names:
                continue
            old = other.GetAttribute(attribute.GetName()) if other else None
            times = {*sample_times(attribute), *(sample_times(old) if old else ())}
            found |= {time for time in times if not old or not _same(value_at(attribute, time), value_at(old, time))}
    return found


def files_named(path: str) -> tuple[set[str], set[str]]:
    """Return the files that a layer names, and those they name, whether or not they are there or can be read; and those that
    cannot be read as layers.

    What a layer names is taken relative to the layer; a name with a place for numbers stands for the files that there are.
    """
    from ..materials.materialx.documents import files_of_documents
    from ..materials.materialx.filename_tokens import files_at, has_tokens

    named: set[str] = set()
    unreadable: set[str] = set()
    waiting = [os.path.abspath(path)]
    while waiting:
        file = waiting.pop()
        if file in named:
            continue
        named.add(file)
        try:
            if not os.path.isfile(file) or not _is_layer(file):
                continue
            texts = _texts_of(readable_layer(file))
        except StageOpenError:
            unreadable.add(file)
            continue
        for text in texts:
            beside = os.path.normpath(os.path.join(os.path.dirname(file), text))
            waiting += files_at(beside) if has_tokens(beside) else [_file(beside)]
    documents, not_there = files_of_documents(named)
    return named | documents | {_file(each) for each in not_there if os.path.isabs(each)}, unreadable


def _is_layer(file: str) -> bool:
    check_is_text(file)
    return bool(Sdf.FileFormat.FindByExtension(file))


def _texts_of(layer: Sdf.Layer) -> list[str]:
    from pxr import UsdUtils

    texts: list[str] = []

    def note(text: str) -> str:
        texts.append(text)
        return text

    UsdUtils.ModifyAssetPaths(layer, note)
    return [text for text in texts if text and "://" not in text]
