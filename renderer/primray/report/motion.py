"""Statistics of what moves while the shutter is open, for `primray inspect` and the report."""

from __future__ import annotations

from typing import Any

from ..description import MotionSteps, SceneDescription


def motion_facts(description: SceneDescription) -> dict[str, Any] | None:
    """Return the shutter and, by kind, how many things move and which has the most segments; None if nothing moves.

    Shutter times are time codes relative to the frame.
    """
    exposure = description.exposure
    if exposure is None:
        return None
    kinds = dict.fromkeys(steps.kind for steps in description.motion_steps)
    of_kind = {kind: [steps for steps in description.motion_steps if steps.kind == kind] for kind in kinds}
    return {
        "shutter": [exposure.opens, exposure.closes],
        "span": list(exposure.span),
        "moving": {kind: _most(found) for kind, found in of_kind.items()},
    }


def _most(found: list[MotionSteps]) -> dict[str, Any]:
    finest = max(found, key=lambda steps: steps.segments)
    return {
        "count": len(found),
        "segments": finest.segments,
        "why": "error" if finest.by_error else "samples",
        "path": finest.path,
        "error_pixels": max(steps.error for steps in found),
    }
