"""What varies from sample to sample: values of attributes, settings, variants, poses, things scattered on surfaces, cameras.

A variation reads its entry of a config, is bound to the stage once (its patterns to prims, its values to types), and then
makes for each sample its part of the edits. It returns what it drew, as JSON has it. All write all that they vary each time,
so that a sample is the same whichever was made before it. They are applied by phase: what is later sees what is earlier.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..arrays import Doubles
from ..camera import Camera, looking_at
from ..composition import VariantChoice, variant_of
from ..errors import SettingsError, did_you_mean
from ..settings import RenderSettings, rows
from .distributions import Choice, Constant, Distribution, Uniform, distribution_of, possible_values
from .document import Entry
from .draws import Draws
from .scatter import Box, Scattering, Surfaces, place_all

if TYPE_CHECKING:
    from ..usd import VariedStage


class Phase(IntEnum):
    VARIANTS = 0
    VALUES = 1
    POSES = 2
    SCATTER = 3
    CAMERA = 4


@dataclass
class SampleState:
    """What a sample's variations edit: the stage, at once or by collected values, and the render's settings."""

    varied: VariedStage
    index: int
    resolution: tuple[int, int]
    choices: list[VariantChoice] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)
    places: dict[str, Doubles] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)


class Variation(Protocol):
    """One entry of `vary`."""

    phase: Phase

    def files(self) -> Sequence[str]:
        """Return files that it names, as its entry has them."""

    def bind(self, varied: VariedStage) -> None:
        """Find what it varies on the stage; SettingsError for what is not there, or has no such values."""

    def apply(self, draws: Draws, state: SampleState) -> Any:
        """Make its part of a sample; return what was drawn."""


class AttributeVariation:
    """Values of attributes, for each of several by itself unless they go `together`."""

    phase = Phase.VALUES

    def __init__(self, entry: Entry) -> None:
        fields = entry.fields(("attribute", "to"), ("together",))
        self._patterns = fields["attribute"].texts()
        self._to = distribution_of(fields["to"])
        self._together = fields["together"].flag() if "together" in fields else False
        self._attributes: list[str] = []

    def files(self) -> Sequence[str]:
        """Return the texts among its values: those of file attributes name files."""
        return [value for value in possible_values(self._to) if isinstance(value, str)]

    def bind(self, varied: VariedStage) -> None:
        self._attributes = [path for pattern in self._patterns for path in varied.attributes(pattern)]
        known = possible_values(self._to)
        for attribute in self._attributes:
            for value in known or (self._to.draw(Draws(0, 0, "a value to check")),):
                varied.check_value(attribute, value)

    def apply(self, draws: Draws, state: SampleState) -> Any:
        one = self._to.draw(draws) if self._together else None
        drawn = {path: one if self._together else self._to.draw(draws.of(path)) for path in self._attributes}
        state.values |= drawn
        return drawn


class SettingVariation:
    """A setting of the render, by its name in RenderSettings."""

    phase = Phase.VALUES

    def __init__(self, entry: Entry) -> None:
        fields = entry.fields(("setting", "to"))
        self._name = setting_name(fields["setting"])
        self._to = distribution_of(fields["to"])
        for value in possible_values(self._to):
            check_setting(fields["to"], self._name, value)

    def files(self) -> Sequence[str]:
        return [str(v) for v in possible_values(self._to) if v is not None] if self._name in FILE_SETTINGS else ()

    def bind(self, varied: VariedStage) -> None:
        pass

    def apply(self, draws: Draws, state: SampleState) -> Any:
        value = self._to.draw(draws)
        state.settings[self._name] = varied_file(state.varied, value) if self._name in FILE_SETTINGS else value
        return value


class VariantVariation:
    """The variant of a prim's variant set; without `to` any of them."""

    phase = Phase.VARIANTS

    def __init__(self, entry: Entry) -> None:
        fields = entry.fields(("variant",), ("to",))
        text = fields["variant"].text()
        try:
            chosen = variant_of(f"{text}=")
        except SettingsError:
            raise fields["variant"].fault(f"{text!r} is no variant set; write one as /World/car:color") from None
        self._prim, self._set = chosen.prim, chosen.set
        self._to = distribution_of(fields["to"]) if "to" in fields else None

    def files(self) -> Sequence[str]:
        return ()

    def bind(self, varied: VariedStage) -> None:
        varied.prims(self._prim)
        names = varied.variants(self._prim, self._set)
        if self._to is None:
            self._to = Choice(tuple(names))
        for name in possible_values(self._to):
            if name not in names:
                hint = did_you_mean(str(name), names, f"its variants: {', '.join(names)}")
                raise SettingsError(
                    f"the variant set {self._set} has no {name!r}; {hint}", where=self._prim, code="dataset-target"
                )

    def apply(self, draws: Draws, state: SampleState) -> Any:
        assert self._to is not None
        name = self._to.draw(draws)
        state.choices.append(VariantChoice(self._prim, self._set, name))
        return name


class PoseVariation:
    """Places of prims: turned and scaled about their own origin, then moved in their parent's space; or from a file.

    The file is an array of NumPy (.npy) of world_from_prim for points as column vectors, (samples, prims, 4, 4); samples
    beyond its end begin again at its first.
    """

    phase = Phase.POSES

    def __init__(self, entry: Entry, folder: Path) -> None:
        fields = entry.fields(("pose",), ("translate", "rotate", "scale", "from"))
        self._entry, self._patterns = entry, fields["pose"].texts()
        self._translate, self._scale = (_optional(fields.get(name)) for name in ("translate", "scale"))
        self._turns_freely = "rotate" in fields and fields["rotate"].plain == "any"
        self._rotate = None if self._turns_freely else _optional(fields.get("rotate"))
        self._file = fields["from"].text() if "from" in fields else None
        others = sorted(fields.keys() & {"translate", "rotate", "scale"})
        if self._file is not None and others:
            raise fields[others[0]].fault("places from a file are whole; leave this out")
        if self._file is None and not others:
            raise entry.fault("it must have translate, rotate, scale or from")
        for name, each in (("translate", self._translate), ("rotate", self._rotate), ("scale", self._scale)):
            if each is not None:
                _vector(each.draw(Draws(0, 0, "a value to check")), fields[name], allows_number=name == "scale")
        self._matrices = None if self._file is None else _matrices(folder / self._file, fields["from"])
        self._prims: list[str] = []

    def files(self) -> Sequence[str]:
        return () if self._file is None else (self._file,)

    def bind(self, varied: VariedStage) -> None:
        self._prims = [path for pattern in self._patterns for path in varied.prims(pattern)]
        if self._matrices is not None and self._matrices.shape[1] != len(self._prims):
            raise self._entry.fault(f"{self._file} places {self._matrices.shape[1]} prims, but there are {len(self._prims)}")
        varied.prepare_placing(self._prims)

    def apply(self, draws: Draws, state: SampleState) -> Any:
        if self._matrices is not None:
            row = state.index % len(self._matrices)
            state.varied.place_in_world(dict(zip(self._prims, self._matrices[row], strict=True)))
            return {"from": self._file, "row": row}
        drawn = {path: self._drawn(draws.of(path)) for path in self._prims}
        state.places |= {path: _placed(state.varied.own_local(path), each) for path, each in drawn.items()}
        return drawn

    def _drawn(self, draws: Draws) -> dict[str, Any]:
        found: dict[str, Any] = {}
        if self._translate is not None:
            found["translate"] = self._translate.draw(draws.of("translate"))
        if self._turns_freely:
            found["rotation"] = draws.of("rotate").rotation().tolist()
        elif self._rotate is not None:
            found["rotate"] = self._rotate.draw(draws.of("rotate"))
        if self._scale is not None:
            found["scale"] = self._scale.draw(draws.of("scale"))
        return found


def _placed(own: Doubles, drawn: Mapping[str, Any]) -> Doubles:
    """Return parent_from_prim: T own R S, for points as column vectors."""
    place = own.copy()
    if "translate" in drawn:
        place[:3, 3] += drawn["translate"]
    if "rotation" in drawn:
        place[:3, :3] = place[:3, :3] @ np.array(drawn["rotation"])
    if "rotate" in drawn:
        place[:3, :3] = place[:3, :3] @ euler_xyz(*drawn["rotate"])
    if "scale" in drawn:
        place[:3, :3] = place[:3, :3] * np.asarray(drawn["scale"], np.float64)  # of columns
    return place


def euler_xyz(x_deg: float, y_deg: float, z_deg: float) -> Doubles:
    """Return the matrix (3, 3), for column vectors, of turns about X, then Y, then Z: USD's xformOp:rotateXYZ."""
    (cx, sx), (cy, sy), (cz, sz) = ((math.cos(math.radians(d)), math.sin(math.radians(d))) for d in (x_deg, y_deg, z_deg))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    turned: Doubles = about_z @ about_y @ about_x
    return turned


class ScatterVariation:
    """Things on surfaces, turned about up, whose boxes do not touch."""

    phase = Phase.SCATTER

    def __init__(self, entry: Entry) -> None:
        fields = entry.fields(("scatter", "surface"), ("gap", "yaw", "upright", "overhang", "avoid", "steepest"))
        self._patterns, self._surface_patterns = fields["scatter"].texts(), fields["surface"].texts()
        self._avoided = fields["avoid"].texts() if "avoid" in fields else []
        yaw = fields["yaw"].numbers(2) if "yaw" in fields else (0.0, 360.0)
        self._steepest = fields["steepest"].number(0, 90) if "steepest" in fields else 45.0
        self._how = Scattering(
            gap=fields["gap"].number(0) if "gap" in fields else 0.0,
            yaw_deg=(yaw[0], yaw[1]),
            upright=fields["upright"].flag() if "upright" in fields else True,
            overhang=fields["overhang"].flag() if "overhang" in fields else False,
        )
        self._prims: list[str] = []
        self._surfaces: list[str] = []
        self._obstacles: list[str] = []

    def files(self) -> Sequence[str]:
        return ()

    def bind(self, varied: VariedStage) -> None:
        found = [[path for pattern in each for path in varied.prims(pattern)] for each in self._all_patterns]
        self._prims, self._surfaces, self._obstacles = found
        varied.prepare_placing(self._prims)
        self._own_surfaces(varied)

    @property
    def _all_patterns(self) -> tuple[list[str], list[str], list[str]]:
        return self._patterns, self._surface_patterns, self._avoided

    def _own_surfaces(self, varied: VariedStage) -> Surfaces:
        triangles = np.concatenate([varied.triangles(path) for path in self._surfaces])
        surfaces = Surfaces(triangles, varied.up, self._steepest)
        if not surfaces:
            raise SettingsError(
                f"no triangle faces up within {self._steepest:g} degrees", where=self._surfaces[0], code="dataset-target"
            )
        return surfaces

    def apply(self, draws: Draws, state: SampleState) -> Any:
        varied = state.varied
        boxes = varied.boxes([*self._prims, *self._obstacles])
        linear = {path: varied.own_world_linear(path) for path in self._prims}
        things = {path: (boxes[path], linear[path]) for path in self._prims}
        obstacles = [Box.of(boxes[path], varied.world_from(path)) for path in self._obstacles]
        placed = place_all(things, self._own_surfaces(varied), obstacles, self._how, draws)
        varied.place_in_world(placed)
        return {path: placed[path].tolist() for path in self._prims}


class ShellVariation:
    """A camera on a shell around a target, which it looks at. Directions are uniform over the part of the sphere."""

    phase = Phase.CAMERA

    def __init__(self, entry: Entry) -> None:
        fields = entry.fields(
            ("shell", "distance"),
            ("elevation", "azimuth", "roll", "aim", "field_of_view", "intrinsics", "distortion", "clip", "nearest"),
        )
        target = fields["shell"]
        self._point = np.array(target.numbers(3)) if isinstance(target.value, list) else None
        self._pattern = None if self._point is not None else target.text()
        self._distance = _range_of(fields["distance"], 1e-9)
        self._elevation = _area_of(fields["elevation"]) if "elevation" in fields else _Elevation(-90.0, 90.0)
        self._azimuth = _range_of(fields["azimuth"]) if "azimuth" in fields else Uniform((0.0,), (360.0,), False)
        self._roll = _range_of(fields["roll"]) if "roll" in fields else Constant(0.0)
        self._aim = distribution_of(fields["aim"]) if "aim" in fields else None
        if self._aim is not None:
            _vector(self._aim.draw(Draws(0, 0, "a value to check")), fields["aim"])
        if "field_of_view" in fields and "intrinsics" in fields:
            raise fields["intrinsics"].fault("a camera has a field of view or intrinsics, not both")
        if "distortion" in fields and "intrinsics" not in fields:
            raise fields["distortion"].fault("distortion needs intrinsics")
        self._view = _range_of(fields["field_of_view"]) if "field_of_view" in fields else Constant(60.0)
        self._intrinsics = fields["intrinsics"].numbers(4) if "intrinsics" in fields else None
        self._distortion = tuple(e.number() for e in fields["distortion"].entries()) if "distortion" in fields else ()
        clip = fields["clip"].numbers(2) if "clip" in fields else (0.0, float(np.finfo(np.float32).max))
        self._clip = (clip[0], clip[1])
        self._nearest = fields["nearest"].number(0) if "nearest" in fields else 0.5 * _least(self._distance)
        self._targets: list[str] = []

    def files(self) -> Sequence[str]:
        return ()

    def bind(self, varied: VariedStage) -> None:
        if self._pattern is not None:
            self._targets = varied.prims(self._pattern)

    def apply(self, draws: Draws, state: SampleState) -> Any:
        target = self._point if self._point is not None else _middle(state.varied, self._targets)
        if self._aim is not None:
            target = target + np.array(self._aim.draw(draws.of("aim")))
        distance = self._distance.draw(draws.of("distance"))
        elevation = math.radians(self._elevation.draw(draws.of("elevation")))
        azimuth = math.radians(self._azimuth.draw(draws.of("azimuth")))
        up = state.varied.up
        x, y = horizontal_axes(up)
        away = math.cos(elevation) * (math.cos(azimuth) * x + math.sin(azimuth) * y) + math.sin(elevation) * up
        eye = target + distance * away
        level = up if abs(math.cos(elevation)) > 1e-6 else x
        pose = looking_at(eye, target, level)
        roll = math.radians(self._roll.draw(draws.of("roll")))
        turn = np.array([[math.cos(roll), -math.sin(roll), 0], [math.sin(roll), math.cos(roll), 0], [0, 0, 1]])
        pose[:3, :3] = pose[:3, :3] @ turn
        state.settings["camera"] = self._camera(pose, state.resolution, draws)
        return {
            "eye": eye.tolist(),
            "target": target.tolist(),
            "distance": distance,
            "elevation": math.degrees(elevation),
            "azimuth": math.degrees(azimuth),
            "roll": math.degrees(roll),
        }

    def _camera(self, pose: Doubles, resolution: tuple[int, int], draws: Draws) -> Camera:
        from dataclasses import replace

        if self._intrinsics is not None:
            fx, fy, cx, cy = self._intrinsics
            k = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
            camera = Camera.from_intrinsics(k, resolution, pose, self._distortion, clipping_range=self._clip)
        else:
            angle = self._view.draw(draws.of("field_of_view"))
            camera = Camera.from_field_of_view(angle, resolution, pose, clipping_range=self._clip)
        return replace(camera, nearest=self._nearest)


@dataclass(frozen=True)
class _Elevation:
    """Elevations of directions that are uniform over a zone of the sphere (Archimedes: its area goes with its height)."""

    low: float
    high: float

    def draw(self, draws: Draws) -> float:
        low, high = (math.sin(math.radians(d)) for d in (self.low, self.high))
        return math.degrees(math.asin(min(1.0, max(-1.0, draws.uniform(low, high)))))


def horizontal_axes(up: Doubles) -> tuple[Doubles, Doubles]:
    """Return the directions of azimuth 0 and 90 degrees: +X, and what is counterclockwise of it seen from above."""
    x = np.array([1.0, 0.0, 0.0])
    return x, np.cross(up, x)


def _range_of(entry: Entry, least: float = -math.inf) -> Distribution:
    """Return a distribution of numbers: two in a list are its ends."""
    if isinstance(entry.value, list):
        low, high = entry.numbers(2)
        if not least <= low <= high:
            raise entry.fault("the least is above the greatest" if low > high else f"{low:g} is not {least:g} or more")
        return Uniform((low,), (high,), False)
    if not isinstance(entry.value, dict):
        return Constant(entry.number(least))
    found = distribution_of(entry)
    for value in (*possible_values(found), found.draw(Draws(0, 0, "a value to check"))):
        if isinstance(value, bool) or not isinstance(value, int | float) or value < least:
            raise entry.fault(f"{value!r} is not a number of {least:g} or more")
    return found


def _area_of(entry: Entry) -> Distribution | _Elevation:
    if not isinstance(entry.value, list):
        return _range_of(entry)
    low, high = entry.numbers(2)
    if not -90 <= low <= high <= 90:
        raise entry.fault("an elevation is from -90 to 90 degrees, the least first")
    return _Elevation(low, high)


def _least(distance: Distribution) -> float:
    if isinstance(distance, Uniform):
        return distance.low[0]
    known = possible_values(distance)
    return float(min(known)) if known else 0.0


def _middle(varied: VariedStage, paths: Sequence[str]) -> Doubles:
    """Return the middle of the prims' boxes in the world."""
    boxes = [Box.of(box, varied.world_from(path)) for path, box in varied.boxes(paths).items()]
    reach = [np.abs(box.axes) @ box.half for box in boxes]
    low = np.min([box.center - each for box, each in zip(boxes, reach, strict=True)], axis=0)
    high = np.max([box.center + each for box, each in zip(boxes, reach, strict=True)], axis=0)
    middle: Doubles = (low + high) / 2
    return middle


def _optional(entry: Entry | None) -> Distribution | None:
    return None if entry is None else distribution_of(entry)


def _vector(value: Any, entry: Entry, *, allows_number: bool = False) -> None:
    if allows_number and isinstance(value, int | float) and not isinstance(value, bool):
        return
    is_vector = isinstance(value, list) and len(value) == 3 and all(isinstance(each, int | float) for each in value)
    if not is_vector:
        raise entry.fault(f"it must be three numbers{', or one' if allows_number else ''}, not {value!r}")


def _matrices(path: Path, entry: Entry) -> Doubles:
    try:
        found = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise entry.fault(f"{path} cannot be read: {error}") from None
    if found.ndim != 4 or found.shape[2:] != (4, 4) or not len(found) or found.dtype.kind != "f":
        raise entry.fault(f"it must hold floats of shape (samples, prims, 4, 4), not {found.dtype} of shape {found.shape}")
    if not (np.isfinite(found).all() and (found[..., 3, :] == (0, 0, 0, 1)).all()):
        raise entry.fault("its matrices must be finite, for points as column vectors: their last row is 0 0 0 1")
    return np.asarray(found, np.float64)


FILE_SETTINGS = ("dome", "session_layer")


def setting_name(entry: Entry) -> str:
    """Return the name of a setting; a fault of the entry where there is none, or where it is not one sample's."""
    name, names = entry.text(), [row.name for row in rows(RenderSettings)]
    if name not in names:
        raise entry.fault(f"there is no setting {name!r}; {did_you_mean(name, names, 'docs/library.md lists them')}")
    return name


def check_setting(entry: Entry, name: str, value: Any) -> None:
    try:
        RenderSettings(**{name: value})
    except SettingsError as error:
        raise entry.fault(error.message) from None


def varied_file(varied: VariedStage, value: Any) -> Any:
    return value if value is None else varied.file(str(value))


_KINDS: dict[str, Callable[[Entry, Path], Variation]] = {
    "attribute": lambda entry, folder: AttributeVariation(entry),
    "setting": lambda entry, folder: SettingVariation(entry),
    "variant": lambda entry, folder: VariantVariation(entry),
    "pose": PoseVariation,
    "scatter": lambda entry, folder: ScatterVariation(entry),
    "shell": lambda entry, folder: ShellVariation(entry),
}


def variation_of(entry: Entry, folder: Path) -> Variation:
    """Return the variation that an entry describes, by the key that says its kind."""
    kinds = [name for name in entry.items() if name in _KINDS]
    if len(kinds) != 1:
        raise entry.fault(f"it must have one of the keys {', '.join(_KINDS)}, which says what varies")
    return _KINDS[kinds[0]](entry, folder)
