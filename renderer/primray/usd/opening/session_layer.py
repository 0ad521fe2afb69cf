"""The session layer of a stage opened by primray: empty, stronger than the given session layers, and with their metadata.

USD reads metadata of a stage (expression variables, time codes per second, units, renderSettingsPrimPath) from its root layer
and its session layer alone, never from sublayers of either. A layer below ours therefore counts as a session layer only if its
metadata are repeated in ours. Its opinions stay where they are, and its relative paths are still anchored to it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from pxr import Sdf, Usd

from ..querying.guarded import FAILURES
from ..querying.stage_values import layer_value

# Fields that USD composes from every layer of a stack: repeated in our layer, they would count twice.
_COMPOSED = frozenset({"subLayers", "subLayerOffsets", "layerRelocates", "primOrder", "primChildren"})
_VARIABLES = "expressionVariables"


def session_over(weaker: Sequence[Sdf.Layer], muted: Collection[str] = ()) -> Sdf.Layer:
    """Return a new session layer above these, strongest first, with their metadata repeated in it."""
    session = Sdf.Layer.CreateAnonymous("session.usda")
    session.subLayerPaths = [str(layer.identifier) for layer in weaker]
    _write(session, _metadata(weaker, muted))
    return session


def follow_session_layers(stage: Usd.Stage) -> None:
    """Update the metadata that `session_over` has repeated after edits of the layers below."""
    session = stage.GetSessionLayer()
    found = _metadata([layer for layer in map(Sdf.Layer.Find, session.subLayerPaths) if layer], stage.GetMutedLayers())
    before = {name: layer_value(session, name) for name in _names(session)}
    if found != before:
        with Sdf.ChangeBlock():
            for name in before.keys() - found.keys():
                session.pseudoRoot.ClearInfo(name)
            _write(session, {name: value for name, value in found.items() if before.get(name) != value})


def _write(session: Sdf.Layer, metadata: dict[str, Any]) -> None:
    for name, value in metadata.items():
        try:
            session.pseudoRoot.SetInfo(name, value)
        except FAILURES:  # a value whose type is not the schema's; reported for the layer that has it
            continue


def _metadata(layers: Sequence[Sdf.Layer], muted: Collection[str]) -> dict[str, Any]:
    """Compose the layers' metadata, strongest first. USD reads only the expression variables of a muted session layer."""
    found: dict[str, Any] = {}
    for layer in layers:
        for name in _names(layer):
            if name == _VARIABLES or layer.identifier not in muted:
                value = _anchored(layer_value(layer, name), layer)
                found[name] = _over(found[name], value) if name in found else value
    return found


def _names(layer: Sdf.Layer) -> list[str]:
    return [str(name) for name in layer.pseudoRoot.ListInfoKeys() if name not in _COMPOSED]


def _over(stronger: Any, weaker: Any) -> Any:
    """Compose two opinions as USD does: dictionaries entry by entry, all else by strength."""
    if not (isinstance(stronger, dict) and isinstance(weaker, dict)):
        return stronger
    both = {name: _over(stronger[name], weaker[name]) for name in stronger.keys() & weaker.keys()}
    return {**weaker, **stronger, **both}


def _anchored(value: Any, layer: Sdf.Layer) -> Any:
    """Return the value with relative asset paths made absolute, as the layer resolves them."""
    if isinstance(value, dict):
        return {name: _anchored(entry, layer) for name, entry in value.items()}
    if isinstance(value, Sdf.AssetPath) and value.path and not value.path.startswith("`"):
        return Sdf.AssetPath(str(layer.ComputeAbsolutePath(value.path)))
    return value
