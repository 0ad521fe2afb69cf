"""Upload of volumes: grids of voxels, each once, media in them, and the light that they emit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..description import VolumeEmission, VolumeMedium
from ..description.motion import handed_over
from ..volumes.volume_grid import VolumeGrid
from . import compiled
from .inputs import filled, phase_number


class VolumeUpload:
    """Uploads volumes to a builder; instances that are left out are reported in `warnings`."""

    def __init__(self, builder: compiled.SceneBuilder, warnings: list[tuple[str, str, str]]) -> None:
        self._builder, self._warnings = builder, warnings
        self._numbers: dict[int, int] = {}  # the core's number of a grid, by identity
        self._blurred: dict[tuple[int, int], int] = {}  # and of one that velocities blur

    def add(self, media: Sequence[VolumeMedium], emissions: Sequence[VolumeEmission]) -> None:
        for medium in media:
            made = filled(
                compiled.MediumInput(),
                grid=self._blurred_grid(medium),
                albedo_grid=-1 if medium.albedo_grid is None else self._grid(medium.albedo_grid),
                extinction=medium.extinction,
                albedo=medium.albedo,
                phase=phase_number(medium),
                camera=compiled.CameraVisibility[medium.camera.value],
                **_instances(medium),
            )
            self._note(medium.path, len(self._builder.add_medium(made)))
        for emission in emissions:
            glow = filled(
                compiled.VolumeEmissionInput(),
                grid=self._blurred_grid(emission),
                emission=emission.emission,
                camera=compiled.CameraVisibility[emission.camera.value],
                **_instances(emission),
            )
            self._note(emission.path, len(self._builder.add_volume_emission(glow)))

    def _blurred_grid(self, volume: VolumeMedium | VolumeEmission) -> int:
        if volume.blur is None:
            return self._grid(volume.grid)
        grid, velocity = self._grid(volume.grid), self._grid(volume.blur.velocity)
        number = self._blurred.get((grid, velocity))
        if number is None:
            number = self._blurred[grid, velocity] = self._builder.add_blurred_grid(grid, velocity, volume.blur.frame)
        return number

    def _grid(self, grid: VolumeGrid) -> int:
        number = self._numbers.get(id(grid))
        if number is None:
            width = grid.width
            leaves: npt.NDArray[Any] = grid.leaf_values.reshape(len(grid.leaf_origins), 512 * width)
            tiles: npt.NDArray[Any] = grid.tile_values.reshape(len(grid.tile_origins), width)
            if leaves.dtype == np.float16:
                with np.errstate(over="ignore"):
                    halves = tiles.astype(np.float16)
                if np.isfinite(halves).all():
                    leaves, tiles = leaves.view(np.uint16), halves.view(np.uint16)
                else:
                    leaves = leaves.astype(np.float32)
            places = np.column_stack([grid.tile_origins, grid.tile_sizes]).astype(np.int32)
            number = self._builder.add_grid(
                leaf_origins=np.ascontiguousarray(grid.leaf_origins, np.int32),
                values=np.ascontiguousarray(leaves),
                tiles=np.ascontiguousarray(places),
                tile_values=np.ascontiguousarray(tiles),
                channels=width,
            )
            self._numbers[id(grid)] = number
        return number

    def _note(self, path: str, left_out: int) -> None:
        if left_out:
            message = f"{left_out} instances have a singular or non-finite matrix and are left out"
            self._warnings.append(("singular-transform", path, message))


def _instances(volume: VolumeMedium | VolumeEmission) -> dict[str, Any]:
    """Return the core's inputs of a volume's instances: the first three rows of each matrix, at each time if they move."""
    motion = volume.motion
    if motion is None:
        return {"world_from_index": np.ascontiguousarray(volume.matrices[:, :3], np.float64).ravel()}
    rows = np.ascontiguousarray(motion.matrices, np.float64).ravel()
    return {"world_from_index": rows, "times": handed_over(motion.times), "turns": motion.turns}
