"""What a checkpoint's film holds of light path expressions: enough to make outputs of it without the stage."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..aov_names import AovRequest, light_path_of
from ..core.light_paths.routes import Routes


@dataclass(frozen=True)
class LightPaths:
    """`expressions` and `members` as of core.routes.Routes; `requests` are outputs of these."""

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
    """From dictionaries of their fields; KeyError or TypeError for what they cannot be."""
    return tuple(AovRequest(str(r["name"]), str(r["source"]), str(r["data_type"]), bool(r["errors"])) for r in value)


def light_paths_of_json(value: Any) -> LightPaths | None:
    """ValueError, TypeError or KeyError for what as_json cannot have made."""
    if value is None:
        return None
    requests = requests_of_json(value["requests"])
    expressions, members = tuple(map(str, value["expressions"])), tuple(map(int, value["members"]))
    known = all(light_path_of(request.source) in expressions for request in requests)
    if not expressions or not known or not all(0 <= mask < 1 << len(expressions) for mask in members):
        raise ValueError(value)
    return LightPaths(requests, expressions, members)
