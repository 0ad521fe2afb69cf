"""Stages with volumes from text, and the small OpenVDB files that they name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from tests import vdb_writer as vdb

from primray.description import SceneDescription
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import open_stage, translate

VOXELS = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(512, 3)
ACTIVE = np.ones(512, bool)


def grid(values: object = 1.0, name: str = "density", **other: object) -> vdb.Grid:
    """A grid of one leaf with these values, one or 512."""
    kind = str(other.get("kind", "float"))
    width = vdb.TYPES[kind][1]
    shape = (512,) if width == 1 else (512, width)
    filled = np.broadcast_to(np.asarray(values, np.float64), shape).copy()
    return vdb.Grid(name=name, leaves={(0, 0, 0): vdb.Leaf(filled, ACTIVE)}, **other)  # type: ignore[arg-type]


def write(folder: Path, *grids: vdb.Grid, name: str = "smoke.vdb") -> None:
    (folder / name).write_bytes(vdb.vdb_bytes(grids))


def field_text(name: str = "density", extra: str = "", grid_name: str | None = None, file: str = "smoke.vdb") -> str:
    return f"""
    def OpenVDBAsset "{name}" {{
        asset filePath = @./{file}@
        token fieldName = "{grid_name or name}"
        {extra}
    }}
"""


def volume_text(fields: Mapping[str, str] | None = None, extra: str = "", bound: str = "") -> str:
    """A Volume with fields below it, by name: their extra attributes."""
    fields = {"density": ""} if fields is None else fields
    relationships = "\n".join(f"rel field:{name} = <{name}>" for name in fields)
    schema = '(prepend apiSchemas = ["MaterialBindingAPI"])' if bound else ""
    binding = f"rel material:binding = <{bound}>" if bound else ""
    return f"""
def Volume "Smoke" {schema} {{
    {binding}
    {relationships}
    {extra}
    {"".join(field_text(name, own) for name, own in fields.items())}
}}
"""


def translated(
    folder: Path, text: str, settings: RenderSettings | None = None, meters_per_unit: float = 1.0
) -> tuple[SceneDescription, list[tuple[str, str]], list[str]]:
    """The description, the diagnostics as (code, prim path), and their messages."""
    path = folder / "stage.usda"
    path.write_text(f'#usda 1.0\n(\n    upAxis = "Y"\n    metersPerUnit = {meters_per_unit}\n)\n{text}')
    diagnostics = Diagnostics()
    stage = open_stage(str(path), diagnostics)
    description, told = translate(stage, settings or RenderSettings())
    shown = [d for d in told if d.code not in ("camera-automatic", "default-light")]
    return description, [(d.code, d.prim_path) for d in shown], [d.message for d in shown]
