"""The scenes that only we are measured on: those of the comparison (peers/scenes.py), and the project's own meadow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .peer_runs import facts, folder_of
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
    time_code: float | None = None


def bench_scene(name: str) -> BenchScene:
    """Written if it is not there yet."""
    if name == "meadow":
        return BenchScene(name, ROOT / "scenes/showcase/meadow/scene.usda", None, (480, 270), None)
    about = facts(name)
    width, height = about["resolution"]
    return BenchScene(
        name, folder_of(name) / f"{name}.usdc", CAMERA, (width, height), about["depth"], 0.0 if about.get("motion") else None
    )


def available() -> list[BenchScene]:
    return [bench_scene(name) for name in (*SCENES, "meadow")]
