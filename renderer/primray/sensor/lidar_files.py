"""Files of lidar scans: NumPy's .npy, PCD 0.7 (the Point Cloud Library's), LAS 1.4 by laspy. A scan has the same bytes."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..errors import SettingsError
from ..images.image import replacing
from ..images.output_path import check_folder
from ..version import __version__

if TYPE_CHECKING:
    from .lidar import LidarScan

FIRST_OWN_CLASS = 64  # of LAS: those below are ASPRS's
LAST_CLASS = 255
LAS_STEP = 1e-4  # metres: of coordinates, unless they do not fit into 32 bits
# Fields of PCD files beside x, y and z, with the names that readers of lidars know.
PCD_FIELDS = {
    "intensity": "intensity",
    "ring": "channel",
    "time": "time",
    "range": "range",
    "return_number": "return_number",
    "number_of_returns": "number_of_returns",
    "object_id": "object_id",
    "class_id": "class_id",
}


def check_output(path: Path) -> None:
    """Raise SettingsError unless scans can be written at `path`."""
    if path.suffix.lower() not in WRITERS:
        sentence = f"a scan is written as {', '.join(WRITERS)}, not {path.suffix or 'without an ending'}"
        raise SettingsError(sentence, where=str(path), code="unknown-format")
    if path.suffix.lower() == ".las":
        _laspy(path)
    check_folder(path)


def write(scan: LidarScan, path: Path, axes: str) -> Path:
    check_output(path)
    positions = scan.positions(axes)
    with replacing(path) as temporary:
        WRITERS[path.suffix.lower()](scan, positions, axes, temporary)
    return path


def _write_array(scan: LidarScan, positions: Doubles, axes: str, path: str) -> None:
    points = scan.points.copy()
    points["x"], points["y"], points["z"] = positions.T
    with Path(path).open("wb") as file:
        np.save(file, points)


def _write_pcd(scan: LidarScan, positions: Doubles, axes: str, path: str) -> None:
    # Single precision, as readers expect, resolves 15 micrometres at 200 metres; worlds may be larger.
    place = "<f8" if axes == "world" else "<f4"
    own = scan.points.dtype
    rows = np.zeros(
        len(positions),
        np.dtype([(axis, place) for axis in "xyz"] + [(name, own[of].str) for name, of in PCD_FIELDS.items()]),
    )
    rows["x"], rows["y"], rows["z"] = positions.T
    for name, of in PCD_FIELDS.items():
        rows[name] = scan.points[of]
    assert rows.dtype.names is not None
    kinds = [rows.dtype[name] for name in rows.dtype.names]
    header = "\n".join(
        [
            "# .PCD v0.7 - Point Cloud Data file format",
            "VERSION 0.7",
            f"FIELDS {' '.join(rows.dtype.names)}",
            f"SIZE {' '.join(str(kind.itemsize) for kind in kinds)}",
            f"TYPE {' '.join({'f': 'F', 'u': 'U', 'i': 'I'}[kind.kind] for kind in kinds)}",
            f"COUNT {' '.join('1' for _ in kinds)}",
            f"WIDTH {len(rows)}",
            "HEIGHT 1",
            "VIEWPOINT 0 0 0 1 0 0 0",
            f"POINTS {len(rows)}",
            "DATA binary\n",
        ]
    )
    Path(path).write_bytes(header.encode("ascii") + rows.tobytes())


def _laspy(path: Path | str) -> Any:
    try:
        import laspy
    except ImportError:
        sentence = "LAS files are written by laspy: pip install primray[lidar]"
        raise SettingsError(sentence, where=str(path), code="lidar-laspy") from None
    return laspy


def _write_las(scan: LidarScan, positions: Doubles, axes: str, path: str) -> None:
    laspy = _laspy(path)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.creation_date = datetime.date(2000, 1, 1)  # laspy's is today, and the bytes would change from day to day
    header.generating_software, header.system_identifier = f"primray {__version__}"[:32], "primray lidar"
    header.offsets, header.scales = _grid(positions)
    for name, kind in (("object_id", np.uint32), ("class_id", np.uint32), ("ring", np.uint16), ("range", np.float64)):
        header.add_extra_dim(laspy.ExtraBytesParams(name, kind))
    points = scan.points
    las = laspy.LasData(header)
    las.x, las.y, las.z = positions.T
    las.intensity = np.rint(np.clip(points["intensity"], 0, 1).astype(np.float64) * 65535).astype(np.uint16)
    las.return_number, las.number_of_returns = points["return_number"], points["number_of_returns"]
    las.gps_time = points["time"]
    las.classification = las_class(points["class_id"])
    las.object_id, las.class_id, las.range = points["object_id"], points["class_id"], points["range"]
    las.ring = points["channel"]
    with Path(path).open("wb") as file:
        las.write(file)


def las_class(ids: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Return LAS's classification of class ids: 63 more, among those that users define; 0 for none, and beyond 255."""
    moved = ids.astype(np.int64) + FIRST_OWN_CLASS - 1
    return np.where((ids > 0) & (moved <= LAST_CLASS), moved, 0).astype(np.uint8)


def _grid(positions: Doubles) -> tuple[Doubles, Doubles]:
    """Return offsets and steps of coordinates that fit into 32 bits."""
    if not len(positions):
        return np.zeros(3), np.full(3, LAS_STEP)
    low, high = positions.min(axis=0), positions.max(axis=0)
    offsets = np.floor((low + high) / 2)
    reach = np.maximum(high - offsets, offsets - low)
    return offsets, LAS_STEP * 10.0 ** np.ceil(np.log10(np.maximum(reach / (LAS_STEP * (2**31 - 1)), 1.0)))


WRITERS: dict[str, Callable[[LidarScan, Doubles, str, str], None]] = {
    ".npy": _write_array,
    ".pcd": _write_pcd,
    ".las": _write_las,
}
