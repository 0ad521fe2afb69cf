"""The time code range of a stage, read from its root and session layers alone: nothing is composed."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf

from ...errors import SettingsError
from ..querying.stage_values import is_number, layer_value
from .stage import open_layer, root_layer

_KEYS = ("startTimeCode", "endTimeCode")


def time_range(path: str, session_layer: str | None) -> tuple[float, float]:
    """Return startTimeCode and endTimeCode as Usd.Stage resolves them: by the session layer, else by the root layer.

    Raise SettingsError where either is authored in neither, StageOpenError where a layer cannot be opened.
    """
    layers = [root_layer(path)] if session_layer is None else [open_layer(session_layer), root_layer(path)]
    found = [_number(layers, key) for key in _KEYS]
    if None in found:
        missing = " and no ".join(key for key, value in zip(_KEYS, found, strict=True) if value is None)
        sentence = f"{Path(path).name} has no {missing}; write the numbers, such as 1:100"
        raise SettingsError(sentence, where="--frames", code="frames")
    first, last = (value for value in found if value is not None)
    return first, last


def _number(layers: list[Sdf.Layer], key: str) -> float | None:
    return next((float(value) for layer in layers if is_number(value := layer_value(layer, key))), None)
