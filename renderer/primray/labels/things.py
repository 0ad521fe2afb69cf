"""A thing in a picture: one labelled prim as often as it is in the world, with its ids and what is seen of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..aovs import THINGS
from ..images.cryptomatte import MASK, hash_of

if TYPE_CHECKING:
    from ..images.aov import Aov
    from ..usd import LabelledPrim

KITTI_PARTLY, KITTI_LARGELY = 0.1, 0.5  # occlusion
NUSCENES_BINS = 0.4, 0.6, 0.8  # visible share

Box = tuple[float, float, float, float]  # x0, y0, x1, y1 in pixels from the upper left corner of the picture


@dataclass(frozen=True)
class Box3D:
    """An oriented box around all of a thing, in the axes of its prim; lengths in scene units, matrices for column vectors."""

    center: tuple[float, float, float]  # world space
    size: tuple[float, float, float]
    size_m: tuple[float, float, float]  # in metres
    world_from_box: Sequence[Sequence[float]]  # (4, 4), rigid; the box is around the origin of its space
    camera_from_box: Sequence[Sequence[float]]  # to OpenCV's camera: x right, y down, z forward
    extent: (
        Sequence[Sequence[float]] | None
    )  # lowest and highest corner in the prim's own space; None: its transform is singular
    world_from_prim: Sequence[Sequence[float]]  # (4, 4), with the prim's scale


@dataclass(frozen=True)
class Depth:
    """Distances from the camera along its axis, in scene units."""

    nearest: float | None  # of all of the thing that is in front of the camera
    mean: float | None  # over its visible pixels
    center: float | None  # of its 3-D box's centre


@dataclass(frozen=True)
class Keypoint:
    """An authored point of a thing. `v` as in COCO: 0 outside of the picture, 1 hidden, 2 visible."""

    name: str
    position: tuple[float, float, float]  # world space
    pixel: tuple[float, float] | None  # from the upper left corner; None where the camera does not see its direction
    depth: float  # along the camera's axis, in scene units
    v: int


@dataclass(frozen=True)
class Silhouette:
    """What a thing would show if nothing hid it, with its holes and without what is less than half present.

    `box` is on the canvas of 3 x 3 frames, x0, y0, x1, y1 of pixels with ends excluded; `counts` are the run lengths of the
    mask in the frame as COCO has them: down the columns, the first is of pixels outside.
    """

    box: Sequence[int]
    size: Sequence[int]  # height and width of the frame
    counts: Sequence[int]

    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """The pixels (H, W) of the frame."""
        height, width = self.size
        values = np.repeat(np.arange(len(self.counts)) % 2 == 1, self.counts)
        return np.ascontiguousarray(values.reshape(width, height).T)


@dataclass(frozen=True)
class Thing:
    """A labelled prim in a picture, as an entry of the report's `labels.things`.

    >>> image = primray.render("shot.usda", aovs=["object_instance:class"], resolution=(32, 18), spp=2)
    >>> image.things
    ()
    """

    id: int  # in the AOV object_instance:TAXONOMY
    path: str
    taxonomy: str
    class_name: str  # "class" in JSON, as in the formats of data sets
    class_id: int
    parent: int | None = None  # the id of the thing that holds this one
    pixels_visible: int = 0
    pixels_in_frame: int = 0  # if nothing hid it
    pixels_all: int = 0  # likewise, on a canvas of 3 x 3 frames
    truncation: float | None = None
    occlusion: float | None = None
    occlusion_interval: tuple[float, float] | None = None
    box_tight: Box | None = None  # of its visible pixels
    box_loose: Box | None = None  # of all of it, clipped to the picture
    box_all: Box | None = None  # of all of it
    box_3d: Box3D | None = None
    depth: Depth = Depth(None, None, None)
    keypoints: tuple[Keypoint, ...] = ()
    silhouette: Silhouette | None = None  # of what the canvas has of it, where the setting `silhouettes` asks for it

    @property
    def visible_fraction(self) -> float:
        """Share of the thing, on a canvas of 3 x 3 frames, that the picture shows: BOP's visib_fract; 0 where there is none."""
        return self.pixels_visible / self.pixels_all if self.pixels_all else 0.0

    @property
    def nuscenes_visibility(self) -> int:
        """nuScenes' bin of the visible share: 1 up to 40 %, 2 up to 60 %, 3 up to 80 %, 4 beyond."""
        return 1 + sum(self.visible_fraction > bound for bound in NUSCENES_BINS)

    @property
    def kitti_occluded(self) -> int:
        """KITTI's levels, which have no thresholds there: 0 below 10 % hidden, 1 up to 50 %, 2 beyond, 3 unknown."""
        if self.occlusion is None:
            return 3
        return 0 if self.occlusion < KITTI_PARTLY else 1 if self.occlusion <= KITTI_LARGELY else 2

    def as_json(self) -> dict[str, Any]:
        """Return the thing as JSON-compatible values; without `silhouette` where there is none."""
        own = {name: value for name, value in vars(self).items() if name != "silhouette" or value is not None}
        return {("class" if name == "class_name" else name): _as_json(value) for name, value in own.items()}


def _as_json(value: Any) -> Any:
    """Return records as objects and tuples as lists; dataclasses.asdict copies each number of their matrices."""
    if isinstance(value, Box3D | Depth | Keypoint | Silhouette):
        return {name: _as_json(inner) for name, inner in vars(value).items()}
    return [_as_json(inner) for inner in value] if isinstance(value, tuple) else value


def thing_of_json(says: Mapping[str, Any]) -> Thing:
    """Return the thing of an entry of `labels.things`."""
    own = {("class_name" if name == "class" else name): value for name, value in says.items()}
    for name in ("box_tight", "box_loose", "box_all", "occlusion_interval"):
        own[name] = None if own.get(name) is None else tuple(own[name])
    own["box_3d"] = None if own.get("box_3d") is None else Box3D(**own["box_3d"])
    own["depth"] = Depth(**own["depth"])
    own["keypoints"] = tuple(map(_keypoint_of_json, own["keypoints"]))
    own["silhouette"] = None if own.get("silhouette") is None else Silhouette(**own["silhouette"])
    return Thing(**own)


def _keypoint_of_json(says: Mapping[str, Any]) -> Keypoint:
    x, y, z = says["position"]
    pixel = None if says["pixel"] is None else (says["pixel"][0], says["pixel"][1])
    return Keypoint(says["name"], (x, y, z), pixel, says["depth"], says["v"])


def mask_of(thing: Thing, things: Sequence[Thing], aovs: Mapping[str, Aov]) -> npt.NDArray[np.bool_]:
    """Return the pixels (H, W) that show a thing, or another that it holds. KeyError without the AOV of its taxonomy."""
    source = THINGS + thing.taxonomy
    found = next((aov for aov in aovs.values() if aov.source == source), None)
    if found is None:
        raise KeyError(source)
    return np.isin(found.values[..., 0], sorted(ids_within(thing, things)))


def ids_within(thing: Thing, things: Iterable[Thing]) -> set[int]:
    """Return the ids of a thing and of all that it holds."""
    held: dict[int | None, list[int]] = {}
    for other in things:
        if other.taxonomy == thing.taxonomy:
            held.setdefault(other.parent, []).append(other.id)
    found, left = set[int](), [thing.id]
    while left:
        found.add(number := left.pop())
        left += held.get(number, [])
    return found


@dataclass
class Hierarchy:
    """The things of one taxonomy that a picture may show, by path, with the things that hold them."""

    taxonomy: str
    names: list[str] = field(default_factory=list)  # paths
    classes: list[str] = field(default_factory=list)
    prims: list[str] = field(default_factory=list)  # paths on the stage
    parents: list[int] = field(default_factory=list)  # places in these lists; -1: none
    _places: dict[str, int] = field(default_factory=dict)

    def innermost(self, holding: Iterable[LabelledPrim]) -> int:
        """Return the place of the innermost of the labelled prims that hold something, -1 for none; new ones are added."""
        place = -1
        for one in holding:
            if one.name not in self._places:
                self._places[one.name] = len(self.names)
                self.names.append(one.name)
                self.classes.append(one.label)
                self.prims.append(one.prim)
                self.parents.append(place)
            place = self._places[one.name]
        return place

    def above(self, place: int) -> list[int]:
        """Return the places of a thing and of all that hold it."""
        found = []
        while place >= 0:
            found.append(place)
            place = self.parents[place]
        return found


def ids_of_paths(paths: Sequence[str], fixed: Mapping[str, int]) -> tuple[dict[str, int], dict[str, str]]:
    """Return ids by path, and of paths whose own id is taken the path that has it; `fixed` ids stay.

    A path's own id is its MurmurHash3 as in Cryptomatte. Where it is taken, the thing has the next id that is free.
    """
    ids = {path: fixed[path] for path in paths if path in fixed}
    owners = {number: path for path, number in fixed.items()}
    clashes: dict[str, str] = {}
    for path in sorted(set(paths) - set(ids)):
        number = hash_of(path)
        if number == 0 or number in owners:
            clashes[path] = owners.get(number, "")
        while number == 0 or number in owners:
            number = number % MASK + 1
        ids[path] = number
        owners[number] = path
    return ids, clashes
