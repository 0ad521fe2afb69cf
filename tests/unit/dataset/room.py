"""A small stage with a table, three labelled things and two lights, and configs of data sets of it."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from primray.dataset import Config

STAGE = Path(__file__).with_name("room.usda")


def write_room(folder: Path) -> Path:
    return Path(shutil.copy(STAGE, folder / "room.usda"))


def plain_config(**changes: Any) -> dict[str, Any]:
    """A config whose pictures are tiny, with keys changed; None leaves one out."""
    plain: dict[str, Any] = {
        "stage": "room.usda",
        "seed": 7,
        "samples": 3,
        "settings": {"resolution": [16, 12], "spp": 2, "max_depth": 2, "aovs": ["depth"]},
        "pictures": ["png", "npy"],
        "vary": {
            "lamp": {"attribute": "/World/lamp.inputs:intensity", "to": {"log_uniform": [10, 100]}},
            "colours": {"attribute": "/World/props/*.primvars:displayColor", "to": {"uniform": [[0, 0, 0], [1, 1, 1]]}},
            "props": {"scatter": "/World/props/*", "surface": "/World/table", "gap": 0.05},
            "view": {"shell": "/World/table", "distance": [4, 6], "elevation": [20, 70]},
        },
    }
    plain |= changes
    return {key: value for key, value in plain.items() if value is not None}


def config_in(folder: Path, **changes: Any) -> Config:
    """The config, with its stage in the folder."""
    if not (folder / "room.usda").exists():
        write_room(folder)
    return Config.of(plain_config(**changes), folder)
