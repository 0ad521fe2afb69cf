"""Light path expressions in a checkpoint: what is needed to make outputs of its film without the stage."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..aov_names import AovRequest, light_path_of
from ..core.light_path_tables import Routes


@dataclass(frozen=True)
class LightPaths:
    """Outputs (`requests`) that are light path expressions; `expressions` and `members` as in core's Routes."""

    requests: tuple[AovRequest, ...]
    expressions: tuple[str, ...]
    members: tuple[int, ...]

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def light_paths_of_routes(requests: tuple[AovRequest, ...], routes: Routes | None) -> LightPaths | None:
    if routes is None:
        return None
    own = tuple(request for request in requests if light_path_of(request.source) is not None)
    return LightPaths(own, routes.expressions, routes.members)


def requests_of_json(value: Any) -> tuple[AovRequest, ...]:
    """Return requests from dictionaries of their fields; KeyError or TypeError if they are not valid."""
    return tuple(AovRequest(str(r["name"]), str(r["source"]), str(r["data_type"]), bool(r["errors"])) for r in value)


def light_paths_of_json(value: Any) -> LightPaths | None:
    """Return what `as_json` wrote; ValueError, TypeError or KeyError if it is not valid."""
    if value is None:
        return None
    requests = requests_of_json(value["requests"])
    expressions, members = tuple(map(str, value["expressions"])), tuple(map(int, value["members"]))
    known = all(light_path_of(request.source) in expressions for request in requests)
    if not expressions or not known or not all(0 <= mask < 1 << len(expressions) for mask in members):
        raise ValueError(value)
    return LightPaths(requests, expressions, members)
