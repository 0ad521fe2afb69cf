"""The scene under construction (shapes, prototypes, placements and lights translated so far), and a record of it for later
edits.

The record tells where prims of the world are placed, and which shapes and lights leaves became. It is only kept if `is_on`: for
stages that are translated repeatedly (incremental).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ...arrays import Doubles
from ...description import Light, MovingInstances, Placed, Placement, Prototype, Shape, Sphere, VolumeEmission, VolumeMedium
from ..camera.framed_objects import FramedObjects, framed_objects
from ..lights.authored import AuthoredLight
from ..lights.light_links import Links
from ..lights.motion import LightPath
from .context import Context
from .inheritance import ResolvedPrim
from .poses import Poses

if TYPE_CHECKING:  # loaded only where a stage has volumes
    from ..volumes.motion import VolumePath

ShapeAdapter = Callable[[ResolvedPrim, Context], Shape | None]
LightAdapter = Callable[[AuthoredLight, Doubles], Light | None]  # at a matrix world_from_light


@dataclass(frozen=True)
class Adapters:
    """The functions that turn prims into description objects, by prim type."""

    shapes: Mapping[str, ShapeAdapter]
    lights: Mapping[str, LightAdapter]


@dataclass
class TranslatedLeaf:
    """A leaf with the index of the scene's shape, also of the static one, or of the light that it became; None for nothing."""

    leaf: ResolvedPrim
    shape: int | None = None
    light: int | None = None


@dataclass
class Record:
    is_on: bool = False
    poses: dict[str, tuple[Poses, int]] = field(default_factory=dict)  # prims that have a transform, by path
    leaves: dict[str, TranslatedLeaf] = field(default_factory=dict)  # by path
    # Poses that more than leaves depend on: those of instances, instancers and moving prims.
    used: list[tuple[Poses, int]] = field(default_factory=list)
    told: int = 0  # diagnostics before any leaf was translated
    is_plain: bool = True  # each prim has one leaf, which became one object

    def begin(self) -> None:
        """Clear the record for a walk, which may follow an abandoned one."""
        self.poses.clear()
        self.used.clear()

    def note_pose(self, path: str, poses: Poses, pose: int) -> None:
        if self.is_on:
            self.poses[path] = poses, pose

    def note_use(self, poses: Poses, pose: int) -> None:
        if self.is_on:
            self.used.append((poses, pose))

    def note_leaf(self, become: TranslatedLeaf) -> None:
        if self.is_on:
            self.is_plain &= become.leaf.path not in self.leaves
            self.leaves[become.leaf.path] = become


@dataclass
class TranslatedScene:
    """The scene translated so far."""

    adapters: Adapters
    links: Links | None  # which shapes each light illuminates; None: all
    record: Record
    shapes: list[Shape] = field(default_factory=list)
    static: list[Placed] = field(default_factory=list)
    prototypes: list[Prototype] = field(default_factory=list)
    placements: list[Placement] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    media: list[VolumeMedium] = field(default_factory=list)
    volume_emissions: list[VolumeEmission] = field(default_factory=list)
    volume_paths: list[VolumePath] = field(default_factory=list)  # of volumes that move
    has_lights: bool = False  # even if none of them emits anything
    number: dict[int, int] = field(default_factory=dict)  # prototype's index by group
    blur_scales: dict[int, float] = field(default_factory=dict)  # by prototype
    moving_lights: list[tuple[int, LightPath]] = field(default_factory=list)  # light's index, and its path over time

    @property
    def volumes(self) -> list[VolumeMedium | VolumeEmission]:
        return [*self.media, *self.volume_emissions]

    @property
    def framed_objects(self) -> FramedObjects:
        return framed_objects(self.shapes, self.static, self.prototypes, self.placements, self.volumes)

    @property
    def moves(self) -> bool:
        placements = [*self.placements, *(inner for prototype in self.prototypes for inner in prototype.placements)]
        return (
            any(isinstance(level, MovingInstances) for placement in placements for level in placement.levels)
            or any(not isinstance(shape, Sphere) and shape.motion is not None for shape in self.shapes)
            or any(light.motion is not None for light in self.lights)
            or any(volume.motion is not None or volume.blur is not None for volume in self.volumes)
        )
