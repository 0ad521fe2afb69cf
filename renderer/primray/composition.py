"""Settings of how a stage is composed: `--variant`, `--load`, `--mask` and `--session-layer`, checked as text.

Whether the named prims, variant sets and variants exist is checked when the stage is open, in usd/stage/open.py.
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
    """A variant selection: `name` is chosen in the variant set `set` of `prim`."""

    prim: str
    set: str
    name: str  # "": no variant selected


@dataclass(frozen=True)
class Composition:
    """The part of RenderSettings that decides how the stage is opened. The defaults are USD's own."""

    variants: tuple[str, ...] = ()  # PRIM:SET=NAME
    load: tuple[str, ...] | None = None  # prims whose payloads are loaded, including descendants; None: all; (): none
    mask: tuple[str, ...] | None = None  # prims that are populated, with their ancestors and descendants; None: all
    session_layer: str | None = None  # path of a layer whose opinions are stronger than the stage's

    def __post_init__(self) -> None:
        """Raise SettingsError if a value is malformed."""
        for text in self.variants:
            variant_of(text)
        _check_paths("load", self.load or ())
        _check_paths("mask", self.mask or ())
        if self.mask == ():
            raise SettingsError("an empty mask would remove everything from the stage", where="mask", code="mask")

    @property
    def choices(self) -> list[VariantChoice]:
        return [variant_of(text) for text in self.variants]


def variant_of(text: str) -> VariantChoice:
    """Return the variant choice written PRIM:SET=NAME; raise SettingsError for any other text."""
    match = _VARIANT.fullmatch(text)
    if match is None:
        sentence = f"{text!r} is not a variant selection; expected one such as /World/car:color=red"
        raise SettingsError(sentence, where="variants", code="variant")
    return VariantChoice(match["prim"], match["set"], match["name"])


def _check_paths(what: str, paths: Iterable[str]) -> None:
    for path in paths:
        if not path.startswith("/") or (len(path) > 1 and path.endswith("/")):
            sentence = f"{what} needs prim paths such as /World/car, not {os.fspath(path)!r}"
            raise SettingsError(sentence, where=what, code=what)
