"""What a material becomes."""

from __future__ import annotations

from dataclasses import dataclass

from ...description import Surface


@dataclass(frozen=True)
class Material:
    """A translated material. `surface` is None where displayColor is used; `hidden`: opacityThreshold cuts all of it out."""

    surface: Surface | None
    hidden: bool = False
