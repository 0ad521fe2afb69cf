"""The scenes that are measured: the project's own, and those of the peers' comparison where they have been generated."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PEER_SCENES = Path(os.environ.get("PEER_SCENES", Path(tempfile.gettempdir()) / "peer_scenes"))


@dataclass(frozen=True)
class BenchScene:
    name: str
    path: Path
    camera: str | None
    resolution: tuple[int, int]
    max_depth: int | None


ALL = [
    BenchScene("cornell", PEER_SCENES / "cornell_lambert.usdc", "/World/cam", (512, 512), 8),
    BenchScene("instances", PEER_SCENES / "instances_lambert.usdc", "/World/cam", (640, 360), 4),
    BenchScene("bigmesh", PEER_SCENES / "bigmesh_lambert.usdc", "/World/cam", (640, 360), 3),
    BenchScene("meadow", ROOT / "scenes/showcase/meadow/scene.usda", None, (480, 270), None),
]


def available() -> list[BenchScene]:
    return [scene for scene in ALL if scene.path.exists()]
