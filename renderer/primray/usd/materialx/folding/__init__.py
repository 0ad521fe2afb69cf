"""Constant folding of primitive nodes in double precision: channels, arithmetic, adjustments, compositing.

Nodes that depend on the shading point, and those rarely constant (noise, matrices), are not folded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..definitions import Definition
from .adjustments import ADJUSTMENTS
from .arithmetic import ARITHMETIC
from .channels import CHANNELS
from .compositing import COMPOSITING
from .kinds import Fold, Numbers

_FOLDS: dict[str, Fold] = {**ARITHMETIC, **CHANNELS, **ADJUSTMENTS, **COMPOSITING}


def folded(node: Definition, inputs: Mapping[str, object]) -> Numbers | None:
    """Return the value of a node whose inputs are all numbers; None where it is unknown or not finite."""
    fold = _FOLDS.get(node.category)
    width = node.width
    if fold is None or not width or len(node.outputs) > 1:
        return None
    for value in inputs.values():
        if type(value) is not tuple:
            return None
    try:
        made = fold(inputs, width)  # type: ignore[arg-type]
    except (ArithmeticError, ValueError, KeyError, IndexError):
        return None
    return made if len(made) == width and all(map(math.isfinite, made)) else None
