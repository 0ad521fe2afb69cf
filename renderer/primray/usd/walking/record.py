"""Record of a translation for later edits: poses of prims in the world, and which shapes and lights leaves became.

It is only kept if `is_on`: for stages that are translated repeatedly (keeping).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ..resolving.poses import Poses
from ..resolving.resolve import ResolvedPrim


@dataclass
class Become:
    """A leaf with the index of the scene's shape, also of the static one, or of the light that it became; None for nothing."""

    leaf: ResolvedPrim
    shape: int | None = None
    light: int | None = None


@dataclass
class Record:
    is_on: bool = False
    poses: dict[str, tuple[Poses, int]] = field(default_factory=dict)  # prims that have a transform, by path
    leaves: dict[str, Become] = field(default_factory=dict)  # by path
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

    def note_leaf(self, become: Become) -> None:
        if self.is_on:
            self.is_plain &= become.leaf.path not in self.leaves
            self.leaves[become.leaf.path] = become
