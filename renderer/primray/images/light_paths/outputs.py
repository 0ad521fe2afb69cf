"""AOVs of light path expressions, from the film's sums for each expression."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ... import core
from ...aov_names import AovRequest, light_path_of
from ...arrays import Floats
from ..aov import Aov, channel_names, make_aov
from .rounding import groups_apart, rounded


def light_paths_of_film(scene: core.CoreScene, requests: Sequence[AovRequest], film: core.Film) -> dict[str, Aov]:
    """Return AOVs of light path expressions by name."""
    assert scene.routes is not None
    return light_paths_of(requests, scene.routes.expressions, scene.routes.members, film)


def light_paths_of(
    requests: Sequence[AovRequest], expressions: Sequence[str], members: Sequence[int], film: core.Film
) -> dict[str, Aov]:
    """Return AOVs by name.

    `expressions` are in the film's order; `members` are bit sets of expressions that some path may match together.
    """
    means, errors = film.routed_image()
    values = rounded(means, film.pixels[..., :3], groups_apart(members, len(expressions)))
    found: dict[str, Aov] = {}
    for request in requests:
        expression = light_path_of(request.source)
        assert expression is not None
        number = expressions.index(expression)
        found[request.name] = _aov(request, values[number], errors[number] if request.errors else None)
    return found


def _aov(request: AovRequest, values: Floats, errors: Floats | None) -> Aov:
    meaning = f"light of paths that are {light_path_of(request.source)}"
    if request.data_type:
        return replace(make_aov(request, values, errors=errors), meaning=meaning)
    name = request.name if request.prefix is None else request.prefix
    return Aov(values, channel_names(name, ("R", "G", "B")), request.source, meaning, errors=errors)
