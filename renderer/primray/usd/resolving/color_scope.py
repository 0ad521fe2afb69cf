"""Colour spaces that a prim passes on to its descendants."""

from __future__ import annotations

from dataclasses import dataclass

from ...color.color_space import ColorSpace


@dataclass(frozen=True)
class ColorScope:
    """Inherited colour spaces: the nearest colorSpace:name, and custom spaces, the nearest first."""

    name: str = ""
    definitions: tuple[ColorSpace, ...] = ()


NOWHERE = ColorScope()
