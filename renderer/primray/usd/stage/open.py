"""Opening, reopening and reloading of stages: from a path or a Usd.Stage in memory, composed as asked.

Complaints of USD become errors and diagnostics. The time code range of a stage is read here without composing it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pxr import Ar, Sdf, Tf, Usd, UsdUtils, Work

from ...composition import Composition
from ...diagnostics import Diagnostics
from ...errors import AssetError, InvalidSceneError, LimitError, PrimrayError, SettingsError, StageOpenError
from ...file_formats import CODE as OTHER_FORMAT
from ...file_formats import WHAT_IT_IS, advice_for_file, is_pointer_file, refers_to_other_format, why_locked
from ...read_files import check_kept, is_watching, note_read
from ..inspect.light_path_layer import LIGHT_PATHS
from ..materials.materialx.references import Redirection, is_format_message, rebuild_layers, refers_to_documents
from ..materials.materialx.substitute_layers import with_original_names
from .composition import add_load_rules, check_population, choose_variants, note_unloaded, populate, session_over
from .messages import FileNames, check_is_text, error_text, file_names, scene_errors, tf_message
from .metadata import check_rates, is_number, layer_value, not_a_stage, note_units, note_wrong_types, wrong_rate
from .reads import noting

USD_DEFAULTS = Composition()
# USD looks up every value in every layer of a stack: 1000 spheres in 1000 sublayers open and translate in 1.3 s, 3000 in
# 3000 sublayers take minutes.
MAX_SUBLAYERS = 4000
_MOST_ROUNDS = 8  # of documents that bring layers with more documents
# USD warns about these bindings, but applies them.
_BOUND_WITHOUT_API = re.compile(r"Found material bindings on prim at path \((.*)\) but MaterialBindingAPI is not applied")
_BOUND = "Its material is bound and used, though MaterialBindingAPI is not applied."
_ASSET = re.compile("@([^@]+)@")


def _with_faults(text: str) -> str:
    """Return a message of USD's with what is wrong with the files that it names, where that can be recognized."""
    found = []
    for path in dict.fromkeys(_ASSET.findall(text)):
        if is_pointer_file(path):
            found.append(f" {path}: {WHAT_IT_IS}.")
        elif (locked := why_locked(path)) is not None:
            found.append(f" {path}: {locked}.")
        elif refers_to_other_format(path) and os.path.isfile(path):
            found.append(f" {path}: {advice_for_file(path)}")
    return text + "".join(found)


@contextmanager
def usd_messages(diagnostics: Diagnostics, known: Callable[[str], bool] = lambda text: False) -> Iterator[None]:
    """Keep USD's warnings off stderr and record those that `known` does not cover as diagnostics, with failed reads.

    Raise InvalidSceneError where USD fails in a call that is not guarded.
    """
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        with _with_names(diagnostics), noting(diagnostics), scene_errors():
            yield
    finally:
        for message in delegate.TakeUncoalescedDiagnostics():
            text = error_text(message, "commentary").strip()
            bound = _BOUND_WITHOUT_API.match(text)
            if bound:
                diagnostics.add("binding-api", bound[1], _BOUND, "material:binding")
            elif text and not known(text):
                diagnostics.add("usd-message", "", _with_faults(text))
        del delegate


@contextmanager
def _with_names(diagnostics: Diagnostics) -> Iterator[None]:
    """Shorten file names in the messages of errors as in diagnostics; their `where` stays as given."""
    try:
        yield
    except PrimrayError as error:
        error.message = diagnostics.shown(error.message)
        raise


def open_stage(
    source: str | os.PathLike[str] | Usd.Stage, diagnostics: Diagnostics, composition: Composition = USD_DEFAULTS
) -> Usd.Stage:
    """Return the composed stage; raise StageOpenError if there is none, SettingsError if it lacks what `composition` names.

    A Usd.Stage is used as it is or, where `composition` asks for more, composed again from its layers and left unchanged.
    """
    if not isinstance(source, str | os.PathLike | Usd.Stage):
        raise not_a_stage(source)
    if not isinstance(source, Usd.Stage):
        check_is_text(os.fspath(source))
    diagnostics.name_files(_names_of(source).in_text)
    if isinstance(source, Usd.Stage) and composition == USD_DEFAULTS and not refers_to_documents(source):
        return _noted(lambda: source, diagnostics, composition)
    return _noted(lambda: _composed(source, composition, diagnostics), diagnostics, composition)


def recheck_stage(stage: Usd.Stage, diagnostics: Diagnostics, composition: Composition = USD_DEFAULTS) -> None:
    """Report what opening would report for a stage that has been composed so and edited since."""
    diagnostics.name_files(_names_of(stage).in_text)
    _noted(lambda: stage, diagnostics, composition)


def _composed(source: str | os.PathLike[str] | Usd.Stage, composition: Composition, diagnostics: Diagnostics) -> Usd.Stage:
    if isinstance(source, Usd.Stage):
        return _compose(source.GetRootLayer(), source, composition, "", diagnostics)
    path = os.fspath(source)
    return _compose(root_layer(path), None, composition, path, diagnostics)


def _noted(opened: Callable[[], Usd.Stage], diagnostics: Diagnostics, composition: Composition) -> Usd.Stage:
    """Return the opened stage, and report what concerns it as a whole: composition errors, rates, units, metadata."""
    composed: list[str] = []
    with usd_messages(
        diagnostics, lambda text: is_format_message(text) or any(line in with_original_names(text) for line in composed)
    ):
        stage = opened()
        for error in stage.GetCompositionErrors():
            text = error_text(error)
            composed.append(with_original_names(text))
            diagnostics.add("composition-error", _site(error), _with_faults(text))
    if composition.load is not None:
        note_unloaded(stage, diagnostics)
    with _with_names(diagnostics):
        check_rates(stage, diagnostics)
    note_units(stage, diagnostics)
    note_wrong_types(stage, diagnostics)
    note_layers(stage)
    return stage


def note_layers(stage: Usd.Stage) -> None:
    """Note the layers as read files, but for those of light paths, which the command that made them may write again."""
    if is_watching():
        for layer in stage.GetUsedLayers():
            if layer and layer.realPath and not layer.GetPrimAtPath(f"/{LIGHT_PATHS}"):
                note_read(layer.realPath)
        check_kept()


def _names_of(source: str | os.PathLike[str] | Usd.Stage) -> FileNames:
    return file_names(source) if isinstance(source, Usd.Stage) else FileNames(os.fspath(source))


def scratch_copy(stage: Usd.Stage) -> Usd.Stage:
    """Return another stage on the same layers, with a session layer of its own to write to, above the original's."""
    session = session_over(_layers_of_session(stage), stage.GetMutedLayers())
    made = populate(stage.GetRootLayer(), session, stage.GetPathResolverContext(), None)
    _follow(made, stage)
    return made


def _check_sublayers(root: Sdf.Layer) -> None:
    if len(root.subLayerPaths) > MAX_SUBLAYERS:
        raise LimitError(
            f"The layer has {len(root.subLayerPaths):,} sublayers, {MAX_SUBLAYERS:,} are allowed: the time USD takes grows "
            "with the square of their number.",
            where=root.identifier,
            code="sublayer-limit",
        )


def _compose(
    root: Sdf.Layer, base: Usd.Stage | None, composition: Composition, path: str, diagnostics: Diagnostics
) -> Usd.Stage:
    """Compose the stage, again after its references to MaterialX documents have been redirected.

    Documents are looked for before variants are chosen, since a variant set may come from one, and after, since variants may
    bring more.
    """
    _check_sublayers(root)
    others = Redirection()
    stage = _populated(root, base, composition, path, others)
    for choices in ([], composition.choices):
        choose_variants(stage, choices)
        for _ in range(_MOST_ROUNDS):
            if not refers_to_documents(stage) or not others.redirect(stage, diagnostics):
                break
            stage = _populated(root, base, composition, path, others)
            choose_variants(stage, choices)
    others.apply_looks(stage)
    check_population(stage, composition)
    return stage


def _populated(root: Sdf.Layer, base: Usd.Stage | None, composition: Composition, path: str, others: Redirection) -> Usd.Stage:
    session = session_over(_session_layers(base, composition, others), base.GetMutedLayers() if base is not None else ())
    context = base.GetPathResolverContext() if base is not None else None
    try:
        stage = populate(others.of(root), session, context, composition)
        if base is not None:
            _follow(stage, base)
        add_load_rules(stage, composition.load)
    except Tf.ErrorException as error:
        if (rate := wrong_rate(root)) is not None:
            message = f"timeCodesPerSecond is {rate}, not a number: USD cannot open the stage."
            raise InvalidSceneError(message, where=path or root.identifier, code="time-metadata") from None
        raise StageOpenError(f"USD cannot open it: {tf_message(error)}", where=path) from None
    return stage


def _follow(stage: Usd.Stage, base: Usd.Stage) -> None:
    """Give the stage everything else that decides about composition in `base`."""
    if base.GetPopulationMask() != Usd.StagePopulationMask.All():
        stage.SetPopulationMask(base.GetPopulationMask())
    stage.SetLoadRules(base.GetLoadRules())
    stage.SetInterpolationType(base.GetInterpolationType())
    stage.MuteAndUnmuteLayers(base.GetMutedLayers(), [])


def _session_layers(base: Usd.Stage | None, composition: Composition, others: Redirection) -> list[Sdf.Layer]:
    """Return the session layers that the stage shall have, strongest first."""
    found = [] if composition.session_layer is None else [open_layer(composition.session_layer)]
    return [others.of(layer) for layer in (*found, *(_layers_of_session(base) if base is not None else ()))]


def _layers_of_session(stage: Usd.Stage) -> list[Sdf.Layer]:
    """Return the stage's session layer as a list; empty for a caller's stage without one."""
    session = stage.GetSessionLayer()
    return [session] if session else []


def root_layer(path: str) -> Sdf.Layer:
    if not os.path.exists(path) and "[" not in path and "://" not in path:
        _check_lock(path)
        raise StageOpenError("There is no such file.", where=path)
    if os.path.isdir(path):
        raise StageOpenError("It is a folder: name a stage in it; `primray sheet FOLDER` shows all of a folder.", where=path)
    return open_layer(path)


def open_layer(path: str, opened: Callable[[str], Sdf.Layer | None] = Sdf.Layer.FindOrOpen) -> Sdf.Layer:
    """Open the layer; raise StageOpenError with USD's reason, or with what kind of file it is instead."""
    check_is_text(path)
    try:
        layer = opened(path)
    except Tf.ErrorException as error:
        _check_file(path)
        raise StageOpenError(f"USD cannot open it: {tf_message(error)}", where=path) from None
    if layer is None:
        _check_file(path)
        missing = not os.path.exists(path) and "[" not in path
        raise StageOpenError("There is no such file." if missing else "USD cannot open it.", where=path)
    return layer


def _check_file(path: str) -> None:
    """Raise StageOpenError where the file is recognized as something other than USD, or is locked."""
    _check_lock(path)
    if is_pointer_file(path):
        raise StageOpenError(f"USD cannot open it: {WHAT_IT_IS}.", where=path) from None
    advice = advice_for_file(path) if os.path.isfile(path) else None
    if advice is not None:
        raise StageOpenError(advice, where=path, code=OTHER_FORMAT) from None


def _check_lock(path: str) -> None:
    """Raise StageOpenError where permissions keep this user from the file, or from the package that it is in."""
    locked = why_locked(str(Ar.SplitPackageRelativePathOuter(path)[0]))
    if locked is not None:
        raise StageOpenError(f"USD cannot open it: {locked}.", where=path) from None


def _site(error: Any) -> str:
    try:
        return str(error.rootSite.path)
    except (AttributeError, UnicodeDecodeError):
        return ""


_RANGE_KEYS = ("startTimeCode", "endTimeCode")


def time_range(path: str, session_layer: str | None) -> tuple[float, float]:
    """Return startTimeCode and endTimeCode as Usd.Stage resolves them: by the session layer, else by the root layer.

    Raise SettingsError where either is authored in neither, StageOpenError where a layer cannot be opened.
    """
    layers = [root_layer(path)] if session_layer is None else [open_layer(session_layer), root_layer(path)]
    found = [_first_number(layers, key) for key in _RANGE_KEYS]
    if None in found:
        missing = " and no ".join(key for key, value in zip(_RANGE_KEYS, found, strict=True) if value is None)
        sentence = f"{Path(path).name} has no {missing}; write the numbers, such as 1:100"
        raise SettingsError(sentence, where="--frames", code="frames")
    first, last = (value for value in found if value is not None)
    return first, last


def _first_number(layers: list[Sdf.Layer], key: str) -> float | None:
    return next((float(value) for layer in layers if is_number(value := layer_value(layer, key))), None)


def reload_layers(root: str, files: Collection[str]) -> None:
    """Reload the layers of the stage at `root` that come from these files (absolute paths).

    Raise StageOpenError at the first that cannot be read; it and those after it stay as they were.
    """
    names = FileNames(root)
    with usd_messages(Diagnostics(names.in_text)):
        for layer in Sdf.Layer.GetLoadedLayers():
            file = _file_of_layer(layer)
            if file in files:
                _reload(layer, names.in_text(file))
        try:
            rebuild_layers(files)
        except AssetError as error:
            raise StageOpenError(error.message, where=names.in_text(error.where)) from None


def _file_of_layer(layer: Sdf.Layer) -> str:
    """Return the layer's file on disk; for a member of a package, the package's."""
    path = str(layer.realPath)
    return os.path.abspath(str(Ar.SplitPackageRelativePathOuter(path)[0])) if path else ""


def _reload(layer: Sdf.Layer, name: str) -> None:
    if (locked := why_locked(_file_of_layer(layer))) is not None:
        raise StageOpenError(f"USD cannot read it: {locked}.", where=name)
    if not os.path.exists(_file_of_layer(layer)):
        raise StageOpenError("There is no such file.", where=name)
    try:
        layer.Reload(force=True)
    except Tf.ErrorException as error:
        raise StageOpenError(f"USD cannot read it: {tf_message(error)}", where=name) from None


def limit_threads(threads: int) -> None:
    """Limit the threads that USD uses beside the calling one; with 1 it starts none. The environment variable
    PXR_WORK_THREAD_LIMIT has precedence."""
    Work.SetConcurrencyLimit(threads)
