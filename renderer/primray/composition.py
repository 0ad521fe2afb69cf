"""How a stage is to be composed: what `--variant`, `--load`, `--mask` and `--session-layer` say, checked as text.

Which prims, sets and names there are is known only once the stage is open: usd/opening/stage.py.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass

from .errors import SettingsError

_VARIANT = re.compile(r"(?P<prim>/[^:=]*):(?P<set>[^:=]+)=(?P<name>[^:=]*)")


@dataclass(frozen=True)
class VariantChoice:
    prim: str
    set: str
    name: str  # "": no variant


@dataclass(frozen=True)
class Composition:
    """The part of RenderSettings that decides how the stage is opened. The defaults are USD's own."""

    variants: tuple[str, ...] = ()  # PRIM:SET=NAME
    load: tuple[str, ...] | None = None  # prims whose payloads are loaded, with all below them; None: all; (): none
    mask: tuple[str, ...] | None = None  # prims that are populated, with all above and below them; None: all
    session_layer: str | None = None  # a layer's path, stronger than the stage

    def __post_init__(self) -> None:
        """SettingsError where it is not even well-formed."""
        for text in self.variants:
            variant_of(text)
        _check_paths("load", self.load or ())
        _check_paths("mask", self.mask or ())
        if self.mask == ():
            raise SettingsError("an empty mask would leave nothing of the stage", where="mask", code="mask")

    @property
    def choices(self) -> list[VariantChoice]:
        return [variant_of(text) for text in self.variants]


def variant_of(text: str) -> VariantChoice:
    """SettingsError unless it reads PRIM:SET=NAME."""
    match = _VARIANT.fullmatch(text)
    if match is None:
        sentence = f"{text!r} is no choice of a variant; write one like /World/car:color=red"
        raise SettingsError(sentence, where="variants", code="variant")
    return VariantChoice(match["prim"], match["set"], match["name"])


def _check_paths(what: str, paths: Iterable[str]) -> None:
    for path in paths:
        if not path.startswith("/") or (len(path) > 1 and path.endswith("/")):
            sentence = f"{what} needs paths of prims such as /World/car, not {os.fspath(path)!r}"
            raise SettingsError(sentence, where=what, code=what)
