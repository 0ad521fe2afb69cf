"""What a translation notes down for edits that come after it: where prims of the world stand, and what leaves have become.

Nothing is noted unless `is_on`: for stages that are translated again and again (keeping).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ..resolving.poses import Poses
from ..resolving.resolve import ResolvedPrim


@dataclass
class Become:
    """A leaf, and which of the scene's shapes and of its static ones it has become, or which light; None for nothing."""

    leaf: ResolvedPrim
    shape: int | None = None
    light: int | None = None


@dataclass
class Record:
    is_on: bool = False
    poses: dict[str, tuple[Poses, int]] = field(default_factory=dict)  # of prims with transforms of their own, by path
    leaves: dict[str, Become] = field(default_factory=dict)  # likewise
    # Poses that more than leaves depend on: instances, instancers, what moves.
    used: list[tuple[Poses, int]] = field(default_factory=list)
    told: int = 0  # diagnostics before any leaf was translated
    is_plain: bool = True  # each leaf is one prim's, and has become one thing

    def begin(self) -> None:
        """A walk, which may have been begun before."""
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
