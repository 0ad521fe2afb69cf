"""The scenes that only we are measured on: those of the comparison (peers/scenes.py), and the project's own meadow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .peer_runs import folder_of
from .peers.scenes import SCENES
from .peers.write_usd import CAMERA

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class BenchScene:
    name: str
    path: Path
    camera: str | None
    resolution: tuple[int, int]
    max_depth: int | None


def available() -> list[BenchScene]:
    """Written where they are not yet."""
    compared = [
        BenchScene(name, folder_of(name) / f"{name}.usdc", CAMERA, made.resolution, made.depth)
        for name, made in ((name, make()) for name, make in SCENES.items())
    ]
    return [*compared, BenchScene("meadow", ROOT / "scenes/showcase/meadow/scene.usda", None, (480, 270), None)]
