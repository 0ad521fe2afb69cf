"""The pictures of docs/volumes.md, rendered from the stages that the page shows. `python -m tests.docs.volumes.pictures`.

The page's `smoke.vdb` is a plume of noise that rises from a small source, with a density and a temperature in kelvins.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
from tests import vdb_writer as vdb
from tests.images.volumes.voxels import voxels

import primray

ROOT = Path(__file__).resolve().parents[3]
PAGE, FOLDER = ROOT / "docs/volumes.md", ROOT / "docs/volumes"
NAMES = ("smoke", "fire", "shafts", "mist")
SIZE = (480, 480)
VOXEL = 0.025  # metres
SHAPE = (64, 112, 64)
Floats = npt.NDArray[np.float64]


def stages() -> dict[str, str]:
    """Return the page's stages: blocks that begin with "#usda 1.0", by the file name in the line above."""
    found = re.findall(r"`(\w+)\.usda`:\n\n((?:    .*\n|\n)+)", PAGE.read_text(encoding="utf-8"))
    return {name: "\n".join(line[4:] for line in text.splitlines()) for name, text in found}


def noise(points: Floats, period: float, rng: np.random.Generator) -> Floats:
    """Return smooth noise in [0, 1] at points (..., 3), which repeats after 16 periods."""
    lattice = rng.random((16, 16, 16))
    q = points / period
    below = np.floor(q).astype(int)
    part = q - below
    part = part * part * (3 - 2 * part)
    found = np.zeros(points.shape[:-1])
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, part, 1 - part), axis=-1)
        x, y, z = np.moveaxis((below + corner) % 16, -1, 0)
        found += weight * lattice[x, y, z]
    return found


def plume() -> tuple[Floats, Floats]:
    """Return the density and the temperature of all voxels."""
    rng = np.random.default_rng(7)
    points = np.moveaxis(np.indices(SHAPE, np.float64), 0, -1)
    height = points[..., 1:2] / SHAPE[1]
    swirl = np.stack([noise(points, 22.0, rng) - 0.5 for _ in range(3)], axis=-1)
    fine = np.stack([noise(points, 9.0, rng) - 0.5 for _ in range(3)], axis=-1)
    moved = points + (26.0 * swirl + 9.0 * fine) * height
    aside = np.hypot(moved[..., 0] - SHAPE[0] / 2, moved[..., 2] - SHAPE[2] / 2)
    wisps = sum(noise(moved, 12.0 / 2**k, rng) / 2**k for k in range(4)) / 1.875
    radius = 4.0 + 17.0 * height[..., 0] ** 0.8
    inside = 1.0 - aside / radius + 1.1 * (wisps - 0.5)
    ends = np.clip((1.0 - height[..., 0]) * 5.0, 0, 1) * np.clip(points[..., 1] / 3.0, 0, 1)
    density = np.clip(1.6 * inside, 0, 1) * ends
    hot = np.clip(1.9 * inside - 2.1 * height[..., 0], 0, 1) * ends
    return density, np.where(hot > 0.02, 900.0 + 1300.0 * hot, 0.0)


def write_smoke(path: Path) -> None:
    matrix = np.diag([VOXEL, VOXEL, VOXEL, 1.0])
    matrix[3, :3] = -VOXEL * SHAPE[0] / 2, 0.0, -VOXEL * SHAPE[2] / 2
    grids = []
    for name, values in zip(("density", "temperature"), plume(), strict=True):
        made = voxels(values)
        rows = zip(made.leaf_origins.tolist(), made.leaf_values, strict=True)
        leaves = {(x, y, z): vdb.Leaf(leaf.astype(np.float64), leaf > 0) for (x, y, z), leaf in rows}
        grids.append(vdb.Grid(name=name, half=name == "density", leaves=leaves, transform=("AffineMap", matrix.ravel())))
    path.write_bytes(vdb.vdb_bytes(grids))


def write_stages(folder: Path) -> None:
    write_smoke(folder / "smoke.vdb")
    for name, text in stages().items():
        (folder / f"{name}.usda").write_text(text, encoding="utf-8")


def render(name: str, folder: Path, spp: int = 256) -> primray.Image:
    return primray.render(folder / f"{name}.usda", resolution=SIZE, spp=spp, denoise=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        write_stages(folder)
        for name in sys.argv[1:] or NAMES:
            shown = oiio.ImageBuf(str(render(name, folder).save(folder / f"{name}.png")))
            shown.specmod().attribute("Compression", "jpeg:90")
            if not shown.write(str(FOLDER / f"{name}.jpg")):
                raise OSError(shown.geterror())


if __name__ == "__main__":
    main()
