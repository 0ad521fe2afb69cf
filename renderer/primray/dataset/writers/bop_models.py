"""BOP's models: models/obj_NNNNNN.ply in mm, with normals, and models_info.json; and which model a thing of a sample is.

A model has the shape of a thing with the scale of its prim, which poses have no place for. Things of one class that have the
same shape are one model; the first of a class has the class's id, others have ids after those of all classes. A thing whose
shape changes, as a variant's does, is another model then. One with more shapes than MOST_SHAPES, as a robot whose joints turn,
has no model. (bop_toolkit, its calc_model_info and docs/bop_datasets_format.md)
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ..packing import Sample
from ..sampler import Sampler

if TYPE_CHECKING:
    from ...labels.shapes import ThingShape
    from ..config import Config
    from ..lock_file import Lock

MOST_SHAPES = 8  # of one thing
ALIKE = 0.005  # differences of boxes, as shares of a diagonal, that rounding and dicing make
ALIKE_AREA = 0.02
RIGID = 1e-3
PAIRS = 1 << 22  # distances at a time


@dataclass(frozen=True, eq=False)
class Model:
    """A shape in mm."""

    points: Doubles  # (N, 3)
    triangles: npt.NDArray[np.int64]  # (M, 3)
    symmetries: Doubles  # (S, 4, 4), for points as column vectors
    axes: Doubles  # (A, 2, 3): a point and a direction

    @property
    def box(self) -> Doubles:
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    def is_like(self, other: Model) -> bool:
        """Return whether two shapes are the same but for their triangles, as far as box and area tell."""
        a, b = self._area(), other._area()
        return are_alike(self.box, other.box) and abs(a - b) <= ALIKE_AREA * max(a, b)

    def _area(self) -> float:
        a, b, c = (self.points[self.triangles[:, k]] for k in range(3))
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


class Models:
    """The models of a data set, and their ids."""

    def __init__(self, classes: int) -> None:
        self._next = classes + 1
        self._of_class: dict[int, int] = {}  # the first model of each class
        self._models: dict[int, Model] = {}
        self._classes: dict[int, int] = {}
        self._shapes: dict[str, list[tuple[Doubles, int]]] = {}  # by path: boxes (2, 3), mm, and models
        self._left_out: set[str] = set()

    def learn(self, samples: Iterable[Sample], sampler: Sampler) -> None:
        """Find the models of all things of the samples, which the sampler makes again where a thing has a new shape."""
        for sample in samples:
            new = {
                thing["path"]: (thing, box)
                for thing in sample.things
                if (box := box_mm(thing, sample)) is not None
                and thing["path"] not in self._left_out
                and self._known(thing["path"], box) is None
            }
            if new:
                shapes = sampler.shapes(sample.index, new.keys())
                for path, (thing, box) in sorted(new.items()):
                    self._add(thing, box, shapes.get(path), sample)

    def _add(self, thing: Mapping[str, Any], box: Doubles, shape: ThingShape | None, sample: Sample) -> None:
        known = self._shapes.setdefault(thing["path"], [])
        if shape is None or len(known) == MOST_SHAPES:
            self._left_out.add(thing["path"])
            return
        model, number = scaled(shape, scale_mm(thing, sample)), thing["class_id"]
        like = (n for n, other in self._models.items() if self._classes[n] == number and other.is_like(model))
        found = next(like, None)
        if found is None:
            found = self._of_class.setdefault(number, number) if number not in self._of_class else self._next
            self._next += found == self._next
            self._models[found], self._classes[found] = model, number
        known.append((box, found))

    def _known(self, path: str, box: Doubles) -> int | None:
        return next((model for own, model in self._shapes.get(path, ()) if are_alike(own, box)), None)

    def of(self, thing: Mapping[str, Any], sample: Sample) -> int | None:
        """Return the id of a thing's model in a sample; None where it has none."""
        box = box_mm(thing, sample)
        return None if box is None or thing["path"] in self._left_out else self._known(thing["path"], box)

    def write(self, folder: Path, used: Iterable[int]) -> None:
        """Write the models whose ids are used."""
        folder.mkdir(parents=True)
        infos = {}
        for number in sorted(set(used)):
            model = self._models[number]
            (folder / f"obj_{number:06d}.ply").write_text(ply_of(model), encoding="ascii")
            infos[str(number)] = info_of(model)
        (folder / "models_info.json").write_text(json.dumps(infos, indent=1) + "\n", encoding="utf-8")


def learnt(samples: Iterable[Sample], config: Config, lock: Lock, classes: int) -> Models:
    """Return the models of all things of the samples."""
    models = Models(classes)
    with TemporaryDirectory(prefix="primray-dataset-") as scratch:
        sampler = Sampler(config, scratch=Path(scratch), classes=lock.classes)
        try:
            models.learn(samples, sampler)
        finally:
            sampler.close()
    return models


def scale_mm(thing: Mapping[str, Any], sample: Sample) -> Doubles:
    """Return the lengths in mm (3,) of the axes of a thing's prim."""
    world = np.array(thing["box_3d"]["world_from_prim"])[:3, :3]
    lengths: Doubles = np.linalg.norm(world, axis=0) * float(sample.record["meters_per_unit"]) * 1000
    return lengths


def box_mm(thing: Mapping[str, Any], sample: Sample) -> Doubles | None:
    """Return the corners (2, 3) of a thing in the space of its model."""
    if thing["box_3d"] is None or thing["box_3d"]["extent"] is None:
        return None
    return np.array(thing["box_3d"]["extent"]) * scale_mm(thing, sample)


def are_alike(one: Doubles, other: Doubles) -> bool:
    diagonal = np.linalg.norm(one[1] - one[0])
    return bool(np.abs(one - other).max() <= ALIKE * diagonal)


def scaled(shape: ThingShape, mm: Doubles) -> Model:
    """Return the model of a shape; symmetries that its scale ends are left out."""
    size, back = np.diag([*mm, 1.0]), np.diag([*(1 / mm), 1.0])
    matrices = size @ shape.symmetries @ back
    linear = matrices[:, :3, :3]
    rigid = np.abs(linear.transpose(0, 2, 1) @ linear - np.eye(3)).max(axis=(1, 2), initial=0) < RIGID
    points, directions = shape.axes[:, 0] * mm, shape.axes[:, 1] * mm
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions / np.where(lengths > 0, lengths, 1)
    round_ones = [k for k, direction in enumerate(directions) if lengths[k] > 0 and _is_round(direction, mm)]
    axes = np.stack([points, directions], axis=1)[round_ones]
    return Model(shape.points * mm, shape.triangles, matrices[rigid & (np.linalg.det(linear) > 0)], axes)


def _is_round(axis: Doubles, mm: Doubles) -> bool:
    """Return whether scales along the prim's axes are the same in all directions across an axis."""
    along = int(np.argmax(np.abs(axis)))
    others = np.delete(mm, along)
    is_own = abs(axis[along]) > 1 - RIGID
    return bool(np.ptp(others) <= RIGID * others.max() if is_own else np.ptp(mm) <= RIGID * mm.max())


def info_of(model: Model) -> dict[str, Any]:
    """Return a model's entry in models_info.json."""
    low, high = model.box.tolist()
    says: dict[str, Any] = {"diameter": diameter_of(model.points)}
    says |= {f"min_{axis}": value for axis, value in zip("xyz", low, strict=True)}
    says |= {f"size_{axis}": b - a for axis, a, b in zip("xyz", low, high, strict=True)}
    others = [matrix for matrix in model.symmetries if np.abs(matrix - np.eye(4)).max() > RIGID]
    if others:
        says["symmetries_discrete"] = [matrix.ravel().tolist() for matrix in others]
    if len(model.axes):
        says["symmetries_continuous"] = [{"axis": d.tolist(), "offset": p.tolist()} for p, d in model.axes]
    return says


def diameter_of(points: Doubles) -> float:
    """Return the largest distance between two points (N, 3)."""
    apart = np.linalg.norm(points - points.mean(axis=0), axis=1)
    order = np.argsort(-apart)
    points, apart, most = points[order], apart[order], 0.0
    step = max(1, PAIRS // len(points))
    for first in range(0, len(points), step):
        # A point and those after it are at most as far apart as their distances to the middle together.
        if 2 * apart[first] <= most:
            break
        others = points[first:]
        squares = ((others[:step, None] - others[None]) ** 2).sum(axis=2)
        most = max(most, float(np.sqrt(squares.max())))
    return most


def ply_of(model: Model) -> str:
    """Return a model as the text of a PLY file."""
    normals = normals_of(model.points, model.triangles)
    header = [
        "ply",
        "format ascii 1.0",
        f"element vertex {len(model.points)}",
        *(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")),
        f"element face {len(model.triangles)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    vertices = [" ".join(f"{value:.7g}" for value in row) for row in np.concatenate([model.points, normals], axis=1).tolist()]
    faces = [f"3 {a} {b} {c}" for a, b, c in model.triangles.tolist()]
    return "\n".join([*header, *vertices, *faces, ""])


def normals_of(points: Doubles, triangles: npt.NDArray[np.int64]) -> Doubles:
    """Return a normal of each point: the sum of its triangles' normals, weighted by their angles there (Thuerrner 1998)."""
    corners = points[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across = _unit(across)
    found = np.zeros(points.shape)
    for k in range(3):
        one, other = (_unit(corners[:, (k + turn) % 3] - corners[:, k]) for turn in (1, 2))
        angle = np.arccos(np.clip((one * other).sum(axis=1), -1, 1))
        np.add.at(found, triangles[:, k], across * angle[:, None])
    return _unit(found)


def _unit(vectors: Doubles) -> Doubles:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Doubles = vectors / np.where(lengths > 0, lengths, 1)
    return unit
