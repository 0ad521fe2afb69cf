"""OpenVDB itself, to compare with: the module `openvdb` of a Python in the environment that PRIMRAY_OPENVDB names.

That is a virtual environment in which `import openvdb` works, or whose package bpy has it (Blender is GPL: primray never
imports it). It runs in a process of its own; tests that ask for it are skipped where the variable is not set.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

VARIABLE = "PRIMRAY_OPENVDB"
# Finds the module in bpy's own folder without loading Blender.
PREAMBLE = """
import glob, json, sys
import numpy as np
for folder in list(sys.path):
    sys.path += glob.glob(folder + "/bpy/*/python/lib/python*/site-packages")
import openvdb
"""
_DUMP = (
    PREAMBLE
    + """
wanted = json.load(open(sys.argv[1]))
grids, _ = openvdb.readAll(wanted["file"])
facts, arrays = [], {}
for k, grid in enumerate(sorted(grids, key=lambda grid: grid.name)):
    count = grid.activeVoxelCount()
    low, high = grid.evalActiveVoxelBoundingBox()
    index = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    back = grid.background
    facts.append({"name": grid.name, "class": str(grid.gridClass), "type": grid.valueTypeName, "count": count,
                  "bounds": [list(low), list(high)] if count else None,
                  "background": [float(v) for v in (back if isinstance(back, tuple) else (back,))],
                  "corners": [list(grid.transform.indexToWorld(p)) for p in index]})
    at = grid.getConstAccessor()
    arrays[f"probes{k}"] = np.array([at.getValue(tuple(p)) for p in wanted["probes"]], np.float64)
    low, high = wanted["box"]
    shape = [b - a for a, b in zip(low, high)]
    width = len(facts[-1]["background"])
    kinds = {"bool": "?", "int32": "i4", "int64": "i8", "double": "f8", "vec3d": "f8", "vec3i": "i4"}
    dense = np.zeros(shape + [3] * (width > 1), kinds.get(grid.valueTypeName, "f4"))
    grid.copyToArray(dense, ijk=tuple(low))
    arrays[f"dense{k}"] = dense
np.savez(wanted["out"], facts=json.dumps(facts), **arrays)
"""
)


def python() -> Path:
    """Return the interpreter that has OpenVDB; skips the test where there is none."""
    folder = os.environ.get(VARIABLE)
    if not folder:
        pytest.skip(f"skipped: no {VARIABLE}")
    return Path(folder, "bin/python")


def run(script: str, *arguments: str) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ran = subprocess.run([python(), "-c", script, *arguments], env=environment, timeout=120, capture_output=True)
    assert ran.returncode == 0, ran.stderr[-500:]


def dump(file: Path, box: list[list[int]], probes: np.ndarray, scratch: Path) -> list[dict[str, Any]]:
    """Return what OpenVDB has in a file, by grids' names: facts, `dense` values in a box (first, beyond the last), `probes`."""
    request, out = scratch / "request.json", scratch / "found.npz"
    request.write_text(json.dumps({"file": str(file), "box": box, "probes": probes.tolist(), "out": str(out)}))
    run(_DUMP, str(request))
    with np.load(out) as found:
        facts = json.loads(str(found["facts"]))
        return [{**fact, "dense": found[f"dense{k}"], "probes": found[f"probes{k}"]} for k, fact in enumerate(facts)]
