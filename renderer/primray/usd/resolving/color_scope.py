"""What a prim hands down of colour spaces."""

from __future__ import annotations

from dataclasses import dataclass

from ...color.color_space import ColorSpace


@dataclass(frozen=True)
class ColorScope:
    """What a prim hands down: the nearest colorSpace:name, and custom spaces, the nearest first."""

    name: str = ""
    definitions: tuple[ColorSpace, ...] = ()


NOWHERE = ColorScope()
