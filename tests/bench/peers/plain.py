"""What the runners read of a scene; needs nothing but NumPy, as it runs in the Pythons of other renderers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

EMITTING = ("glow", "ember")  # looks; to those who read this there is no difference


class PlainScene:
    """The JSON of write_plain.py, and the files beside it."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder = folder
        self.name = name
        self.facts: dict[str, Any] = json.loads((folder / f"{name}.json").read_text())

    def __getitem__(self, key: str) -> Any:
        return self.facts[key]

    def ply(self, mesh: str) -> str:
        return str(self.folder / f"{self.name}_{mesh}.ply")

    def file(self, name: str) -> str:
        return str(self.folder / name)

    def ends(self, mesh: str) -> np.ndarray:  # type: ignore[type-arg]
        """(N, 3): the points of a mesh that bends, when the shutter closes."""
        return np.load(self.folder / f"{self.name}_{mesh}_ends.npy").astype(float)

    def strands(self) -> np.ndarray:  # type: ignore[type-arg]
        """(N, K, 3): control points of cubic B-splines."""
        return np.load(self.folder / f"{self.name}_strands.npy").astype(float)

    def swarms(self) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
        """(N,) the swarm of each that is placed, and (G, 3) their shifts."""
        read = np.load(self.folder / f"{self.name}_swarms.npz")
        return read["swarm"], read["shifts"]

    def matrices(self) -> np.ndarray:  # type: ignore[type-arg]
        """(N, 4, 4), column vectors."""
        return np.load(self.folder / f"{self.name}_placed.npy").astype(float)
