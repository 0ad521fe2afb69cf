"""Makes tests/unit/volumes/files by OpenVDB: small files of its own hand, whose values are formulas.

    PRIMRAY_OPENVDB=folder .venv/bin/python -m tests.openvdb_files

Each has one node of 4096^3 voxels, whose masks alone take 8 kB of 10.
"""

from __future__ import annotations

from pathlib import Path

from tests import openvdb_oracle

FILES = Path(__file__).parent / "unit/volumes/files"

SCRIPT = (
    openvdb_oracle.PREAMBLE
    + """
def write(name, *grids):
    openvdb.write(f"{sys.argv[1]}/{name}.vdb", list(grids))

def numbers(shape, origin):
    x, y, z = np.meshgrid(*[np.arange(n) + o for n, o in zip(shape, origin)], indexing="ij")
    return x, y, z

# A fog volume in halves, with an active tile of 8^3 voxels; the second grid shares its tree under another transform.
fog = openvdb.FloatGrid()
x, y, z = numbers((5, 2, 2), (6, 6, 7))
fog.copyFromArray(((x + 2 * y + 4 * z) / 64).astype(np.float32), ijk=(6, 6, 7))
fog.fill((32, 32, 32), (39, 39, 39), 0.75, True)
fog.name, fog.gridClass, fog.saveFloatAsHalf = "density", openvdb.GridClass.FOG_VOLUME, True
fog.transform = openvdb.createLinearTransform(0.25)
fog["note"] = "written by OpenVDB"
shared = fog.copy()
shared.transform = openvdb.createLinearTransform([[1, 0, 0, 0], [0, 2, 0, 0], [0, 0.5, 1, 0], [10, 20, 30, 1]])
write("fog-half-instance", fog, shared)

ball = openvdb.createLevelSetSphere(radius=0.75, center=(6, 6, 6), voxelSize=0.5, halfWidth=1.5)
ball.name = "ball"
write("level-set", ball)

velocity = openvdb.Vec3SGrid(background=(0, 0, 1))
x, y, z = numbers((3, 3, 3), (9, 1, 2))
velocity.copyFromArray(np.stack([x, y / 2, -z / 4], -1).astype(np.float32), ijk=(9, 1, 2))
velocity.name, velocity.gridClass = "velocity", openvdb.GridClass.STAGGERED
velocity.transform = openvdb.createLinearTransform([[2, 0, 0, 0], [0, 3, 0, 0], [0, 0, 4, 0], [5, 6, 7, 1]])
write("velocity", velocity)

counts = openvdb.Int32Grid(background=-7)
x, y, z = numbers((4, 4, 4), (1, 1, 1))
counts.copyFromArray((x * 100 + y * 10 + z).astype(np.int32), ijk=(1, 1, 1))
counts.fill((128, 0, 0), (255, 127, 127), 5, True)
counts.name = "counts"
write("counts", counts)

marks = openvdb.BoolGrid()
x, y, z = numbers((8, 8, 8), (0, 0, 0))
marks.copyFromArray((x + y + z) % 3 == 0)
marks.name = "marks"
write("marks", marks)
"""
)

if __name__ == "__main__":
    openvdb_oracle.run(SCRIPT, str(FILES))
