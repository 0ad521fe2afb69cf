"""Mixes of lights as settings name them: weights of lights by name, as text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..errors import SettingsError
from .choices import StopAt

Weights = dict[str, tuple[float, float, float]]
Weight = float | Iterable[float]
MOST = 1e20  # largest weight, so that light stays far from the largest float
NO_MIXES: Mapping[str, Any] = {"stop_at": StopAt.PICTURE, "mixes": ()}  # settings of a picture that stops at none of them


def checked_weight(name: str, weight: Weight) -> tuple[float, float, float]:
    """Return a weight for R, G and B; SettingsError if it is not one factor from 0, or three."""
    try:
        values = [float(w) for w in weight] if isinstance(weight, Iterable) else [float(weight)] * 3
    except (TypeError, ValueError):
        values = []
    if len(values) != 3 or not all(0 <= w <= MOST for w in values):
        sentence = f"the weight of a light is one factor from 0 to {MOST:g}, or three for R, G and B, not {weight!r}"
        raise SettingsError(sentence, where=name, code="lights-weight")
    return values[0], values[1], values[2]


def weights_of_text(text: str) -> Weights:
    """Return the weights of a mix like `key=0.5 fill=1,0.8,0.6`; lights that it does not name keep a weight of 1.

    >>> from primray.settings.light_mixes import weights_of_text
    >>> weights_of_text("key=0.5 fill=1,0.8,0.6")
    {'key': (0.5, 0.5, 0.5), 'fill': (1.0, 0.8, 0.6)}
    """
    found: Weights = {}
    for word in text.split():
        name, equals, values = word.rpartition("=")
        try:
            numbers = [float(value) for value in values.split(",")]
        except ValueError:
            numbers = []
        if not equals or not name or len(numbers) not in (1, 3) or name in found:
            sentence = f"a mix of lights is NAME=0.5 or NAME=1,0.8,0.6 for each light, separated by blanks, not {text!r}"
            raise SettingsError(sentence, where="mixes", code="lights-weight")
        found[name] = checked_weight(name, numbers if len(numbers) == 3 else numbers[0])
    return found


def text_of_weights(weights: Weights) -> str:
    """Return the text that `weights_of_text` reads to the same weights."""
    return " ".join(
        f"{name}={','.join(repr(w) for w in (weight if len(set(weight)) > 1 else weight[:1]))}"
        for name, weight in weights.items()
    )


def check_mixes(name: str, mixes: Sequence[str]) -> None:
    """Raise SettingsError for texts that are no mixes."""
    for text in mixes:
        try:
            weights_of_text(text)
        except SettingsError as error:
            raise SettingsError(error.message, where=name, code=error.code) from None
