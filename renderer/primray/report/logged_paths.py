"""Light paths of logged samples: the core's events of a pixel (integrator/path_log.hpp) as vertices from the camera to a light.

What a path adds to its sample goes to the light that it comes from; where a ray meets several lights at once, each has the part
of its radiance. Vertices are scattering events, as light path expressions count them: what light passes straight through, and
the steps of a walk below a surface, are none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from ..core import CoreScene

Event = Mapping[str, Any]
Vector = tuple[float, float, float]

MOST_RUNS, MOST_VERTICES = 24, 64  # of a path that are kept
DIFFUSE = ("diffuse", "behind", "fuzz", "subsurface")
NOWHERE: Vector = (0.0, 0.0, 0.0)


class Names(Protocol):
    """Paths of prims by the numbers in events."""

    def shape(self, event: Event) -> str:
        """Return the path of the shape that an event "hit" is about."""

    def light(self, event: Event) -> tuple[str, bool]:
        """Return the path of an event's light, and whether it is a light rather than a surface or a volume that glows."""

    def is_light(self, path: str) -> bool:
        """Return whether the shape at a path is a light."""


class ShapeNames:
    """Names by the paths that shapes have in their prototypes, which every scene in the core keeps.

    `shown`: other names of such paths.
    """

    def __init__(self, scene: CoreScene, shown: Mapping[str, str] = MappingProxyType({})) -> None:
        assert scene.uploaded is not None
        self._scene, self._uploaded, self._shown = scene, scene.uploaded, shown
        self._lights = {self._named(s.path) for s in self._uploaded.description.shapes if s.light is not None}

    def shape(self, event: Event) -> str:
        return self._named(self._uploaded.shape_rows.path_of(int(event["shape"])))

    def light(self, event: Event) -> tuple[str, bool]:
        if "dome" in event:
            return self._uploaded.dome_paths[int(event["dome"])], True
        number = int(event["light"])
        if path := self._uploaded.light_paths.get(number):
            return path, True
        path = self._named(self._uploaded.shape_rows.path_of(self._scene.shape_of_light(number)[0]))
        return path, self.is_light(path)

    def is_light(self, path: str) -> bool:
        return path in self._lights

    def _named(self, path: str) -> str:
        return self._shown.get(path, path)


@dataclass(frozen=True)
class Vertex:
    """A vertex of a path: "D", "G", "S" or "V", as in light path expressions, the prim that is there, and its point (world)."""

    letter: str
    prim: str
    transmits: bool = False
    point: Vector = NOWHERE


@dataclass(frozen=True)
class Way:
    """The vertices that a path has been scattered at, each linked to those before it: a path in smoke has thousands."""

    before: Way | None = None
    last: Vertex | None = None
    count: int = 0
    runs: tuple[str, ...] = ()  # letters, equal ones in a row as one; the first MOST_RUNS
    first_rough: int = -1  # number of the first vertex that is no mirror and no smooth glass
    sender: Vertex | None = None  # the vertex after that one
    full: Way | None = None  # the way of the first MOST_VERTICES

    def then(self, vertex: Vertex) -> Way:
        runs = self.runs if self.runs[-1:] == (vertex.letter,) else (*self.runs, vertex.letter)[:MOST_RUNS]
        rough = self.count if self.first_rough < 0 and vertex.letter != "S" else self.first_rough
        sender = vertex if self.sender is None and self.first_rough >= 0 else self.sender
        full = self if self.count == MOST_VERTICES else self.full
        return Way(self, vertex, self.count + 1, runs, rough, sender, full)

    @property
    def vertices(self) -> tuple[Vertex, ...]:
        """The vertices from the camera on, the first MOST_VERTICES."""
        found, way = [], self.full or self
        while way.before is not None and way.last is not None:
            found.append(way.last)
            way = way.before
        return tuple(reversed(found))

    @property
    def expression(self) -> str:
        """The vertices in a light path expression, those of one kind in a row as one."""
        parts = "".join("V+" if letter == "V" else f"<.{letter}>+" for letter in self.runs)
        return parts + (".*" if len(self.runs) == MOST_RUNS else "")


@dataclass(frozen=True)
class LightPath:
    """A path with what it adds to its sample, R, G and B before exposure, and before anything is clamped or left out."""

    way: Way
    light: str  # path of the prim that the light comes from; "" where that is a medium
    is_light: bool
    adds: Vector
    camera: Vector = NOWHERE
    end: Vector | None = None  # point on the light; None: at infinity, or not known
    direction: Vector = NOWHERE  # of the last ray, towards the light

    @property
    def expression(self) -> str:
        """Light path expression of the paths of its kind."""
        return f"C{self.way.expression}{'L' if self.is_light else 'O'}"

    @property
    def sender(self) -> str:
        """Path of the prim that sends this light to what the pixel shows, behind mirrors and clear glass; "": a medium does."""
        return self.light if self.way.sender is None else self.way.sender.prim


@dataclass
class _Walker:
    """A path as its events come in."""

    way: Way = field(default_factory=Way)
    pending: Vertex | None = None  # of the last scattering event: a vertex if the next event is deeper
    camera: Vector = NOWHERE
    origin: Vector = NOWHERE
    direction: Vector = NOWHERE
    point: Vector = NOWHERE  # where it is
    prim: str = ""
    lobes: Event | None = None
    shines: list[tuple[str, bool, Vector]] = field(default_factory=list)  # radiance since it was scattered, by light

    def reach(self, depth: int) -> None:
        """Take the vertex of the last scattering event into the way, if a path of this depth was scattered there."""
        if self.pending is not None and depth > self.way.count:
            self.way = self.way.then(self.pending)
        self.pending = None

    def vertex(self, scatter: Event | None) -> Vertex:
        transmits = scatter is not None and scatter.get("transmits", 0) > 0
        return Vertex(_letter(self.lobes, scatter), self.prim, transmits, self.point)


def paths_of(names: Names, events: Iterable[Event]) -> Iterator[LightPath]:
    """Yield the paths of one sample that add to it. Parts of a split path begin with what they have in common."""
    walkers: dict[int, _Walker] = {}
    current = _Walker()  # whose lobes came last: light samples and parts of a split path belong to it
    for event in events:
        kind = event["kind"]
        if kind == "outline ray":  # of an index of its own
            if "contribution" in event:
                light, is_light = names.light(event)
                yield LightPath(Way(), light, is_light, event["contribution"], current.camera)
            continue
        if kind == "light sample":
            if "contribution" in event:
                yield _sampled(names, current, event)
            continue
        if kind == "camera":
            origin, direction = event.get("origin", NOWHERE), event.get("direction", NOWHERE)
            current = walkers[event["part"]] = _Walker(camera=origin, origin=origin, direction=direction)
            continue
        if kind == "scatter":
            direction = event.get("direction", NOWHERE)
            walkers[event["part"]] = _Walker(current.way, current.vertex(event), current.camera, current.point, direction)
            continue
        if kind == "sample":
            continue
        path = walkers.setdefault(event["part"], current)
        path.reach(event["depth"])
        if kind == "hit":
            path.point, path.prim, path.lobes = event.get("position", NOWHERE), names.shape(event), None
            current = path
        elif kind in ("medium", "volume"):
            path.point, path.prim, path.lobes = _ahead(path, event["distance"]), "", None
            current = path
        elif kind == "lobes":
            path.lobes = event
            current = path
        elif kind == "pass":
            path.origin = path.point
        elif kind == "emission":
            light, is_light = _shining(names, path, event)
            path.shines.append((light, is_light, event["radiance"]))
        if "contribution" in event:
            yield from _gathered(path, event)
        elif kind == "dome ray":  # none of it arrives
            path.shines = []


def _sampled(names: Names, path: _Walker, event: Event) -> LightPath:
    way = path.way.then(path.vertex(None))
    light, is_light = names.light(event)
    direction, distance = event.get("direction", NOWHERE), event.get("distance", float("inf"))
    end = _along(path.point, direction, distance) if distance < 1e30 else None
    return LightPath(way, light, is_light, event["contribution"], path.camera, end, direction)


def _gathered(path: _Walker, event: Event) -> Iterator[LightPath]:
    """Yield what a ray gathers at its end, for each light that it meets."""
    adds: Vector = event["contribution"]
    shines = path.shines
    if not shines:  # a medium glows
        shines = [("", False, (1.0, 1.0, 1.0))]
    path.shines = []
    end = path.point if event["kind"] == "gathered" and path.prim else None
    for (light, is_light, _), share in zip(shines, _shares([radiance for *_, radiance in shines]), strict=True):
        part = (adds[0] * share[0], adds[1] * share[1], adds[2] * share[2])
        if any(part):
            yield LightPath(path.way, light, is_light, part, path.camera, end, path.direction)


def _shares(radiances: Sequence[Vector]) -> list[Vector]:
    """Return the part of each in their sum, by channel."""
    if len(radiances) == 1:
        return [(1.0, 1.0, 1.0)]
    sums = [sum(radiance[c] for radiance in radiances) for c in range(3)]
    everything = sum(sums)
    found = []
    for radiance in radiances:
        plain = sum(radiance) / everything if everything else 1 / len(radiances)
        r, g, b = (radiance[c] / sums[c] if sums[c] else plain for c in range(3))
        found.append((r, g, b))
    return found


def _shining(names: Names, path: _Walker, event: Event) -> tuple[str, bool]:
    if "dome" in event or event.get("light", -1) >= 0:
        return names.light(event)
    return path.prim, names.is_light(path.prim)


def _ahead(path: _Walker, distance: float) -> Vector:
    return _along(path.origin, path.direction, distance)


def _along(origin: Vector, direction: Vector, distance: float) -> Vector:
    return (
        origin[0] + direction[0] * distance,
        origin[1] + direction[1] * distance,
        origin[2] + direction[2] * distance,
    )


def _letter(lobes: Event | None, scatter: Event | None) -> str:
    why = None if lobes is None else lobes.get("why")
    if lobes is None or why == "phase function":
        return "V"
    if scatter is not None and scatter.get("delta", 0) > 0:
        return "S"
    if why == "hair":
        return "G"
    if scatter is not None and "diffuse_share" in scatter:
        return "D" if max(scatter["diffuse_share"]) > 0.5 else "G"
    diffuse = sum(max(lobes.get(name, 0.0), 0.0) for name in DIFFUSE)
    return "D" if diffuse > 0.5 * max(lobes.get("presence", 1.0), 1e-9) else "G"
