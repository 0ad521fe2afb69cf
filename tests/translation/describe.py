"""A SceneDescription and its diagnostics as canonical text: sorted keys, rounded numbers, long arrays by their summary."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable
from enum import Enum
from typing import Any

import numpy as np

from primray.description import Input, OpenPbr, PointMotion, PrimvarInput, SceneDescription, TextureInput
from primray.diagnostics import Diagnostic

LONGEST = 36  # longer arrays are summarised
# Named only where they differ from their defaults.
SPARSE = frozenset({"primvars", "inputs", "tiles", "opacity_threshold", "names", "instance", "aovs"})
SPARSE |= {"blades", "blade_rotation_deg", "clipping_planes", "shutter", "pixels", "pixel_aspect_ratio"}
SPARSE |= {"shaping", "shadow", "light_link", "shadow_link", "visible_to_camera", "linked", "link_row", "group"}
SPARSE |= {"rendering_space", "target", "is_color", "layer", "pattern"}
SPARSE |= {"texture_format", "portals", "normalize", "own_color", "shows_own", "light", "photometric"}
SPARSE |= {"open_pbr", "motion", "exposure", "camera_motion", "motion_steps", "diffusion"}
SPARSE |= {"asked", "file", "instances", "may_need_light", "prefix", "media", "volume_emissions", "fog", "interface", "volume"}
SPARSE |= {"distortion", "natural_vignetting", "rim", "channel_magnification", "channel_focus_shift", "nearest"}


def describe(description: SceneDescription, diagnostics: Iterable[Diagnostic], root: str) -> str:
    """`root` is cut from the paths of assets, so that the text does not depend on where the checkout lies."""
    found = {
        "diagnostics": [f"{d.severity.value} {d.code} {d.prim_path}{_dotted(d.attribute)} {d.message}" for d in diagnostics],
        "scene": _plain(description),
    }
    return json.dumps(found, indent=1, sort_keys=True).replace(json.dumps(root)[1:-1], "<root>") + "\n"


def _dotted(attribute: str) -> str:
    return f".{attribute}" if attribute else ""


def _plain(value: Any) -> Any:
    if isinstance(value, TextureInput | PrimvarInput | OpenPbr):
        return _input(value)
    if isinstance(value, PointMotion):
        value = dataclasses.replace(value, points=value.points.reshape(-1, 3))  # of all times
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kind = {"kind": type(value).__name__} if type(value).__name__ in ("Mesh", "SubdivisionMesh", "Sphere") else {}
        shown = (f.name for f in dataclasses.fields(value) if f.name not in SPARSE or getattr(value, f.name) != f.default)
        return kind | {name: _plain(getattr(value, name)) for name in shown}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return _rounded(value)
    return value


def _input(value: Input | OpenPbr) -> Any:
    """What differs from the default, vectors in one line."""
    authored = {f.name: getattr(value, f.name) for f in dataclasses.fields(value) if getattr(value, f.name) != f.default}
    vectors = {n: " ".join(str(_rounded(x)) for x in v) for n, v in authored.items() if isinstance(v, tuple)}
    return {n: vectors.get(n, _plain(v)) for n, v in authored.items()} | {"kind": type(value).__name__}


def _array(value: np.ndarray) -> Any:
    rows = value.reshape(len(value), -1) if value.size else value
    if value.size <= LONGEST:
        return [" ".join(str(_rounded(x)) for x in row) for row in rows] if value.ndim > 1 else rows.ravel().tolist()
    low, high, mean = (" ".join(str(_rounded(x)) for x in np.atleast_1d(f(rows, axis=0))) for f in (np.min, np.max, np.mean))
    return {"shape": list(value.shape), "min": low, "max": high, "mean": mean}


def _rounded(x: float) -> float | int | str:
    if not math.isfinite(x):
        return str(float(x))
    number = float(f"{float(x):.5g}")
    if abs(number) < 1e-7:
        return 0
    return int(number) if number == int(number) and abs(number) < 1e6 else number
