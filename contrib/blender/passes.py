# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a view layer beside Combined: their names and channels in Blender, as Cycles', and what of primray fills them.

Cryptomattes name what Blender does: objects, materials and topmost parents, by the hashes of their names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Pass:
    """`source` is an AOV of primray, or a word of renderer.py's; `rank` is the place among the layers of a Cryptomatte."""

    name: str
    channels: str
    kind: str
    source: str
    rank: int = 0

    def as_request(self) -> dict[str, Any]:
        return asdict(self)


def passes(scene: Any, layer: Any) -> list[Pass]:
    """Return the passes beside Combined that a view layer asks for."""
    found = []
    if layer.use_pass_z:
        found.append(Pass("Depth", "Z", "VALUE", "depth"))
    if layer.use_pass_normal:
        found.append(Pass("Normal", "XYZ", "VECTOR", "normal"))
    # Lower-case letters, as Cycles': compression that loses bits leaves them alone.
    for kind in ("Object", "Material", "Asset"):
        if getattr(layer, f"use_pass_cryptomatte_{kind.lower()}"):
            found += [Pass(f"Crypto{kind}{rank:02d}", "rgba", "COLOR", f"crypto_{kind.lower()}", rank) for rank in ranks(layer)]
    found += [Pass(f"Combined_{group.name}", "RGB", "COLOR", light_group(group.name)) for group in layer.lightgroups]
    if scene.primray.denoise:
        found.append(Pass("Denoised", "RGBA", "COLOR", "denoised"))
    if scene.primray.error_pass:
        found.append(Pass("Error", "X", "VALUE", "error"))
    if scene.primray.error_overlay:
        found.append(Pass("Error Overlay", "RGBA", "COLOR", "error_overlay"))
    return found


def ranks(layer: Any) -> range:
    """Return the layers of a Cryptomatte: two pairs of id and coverage in each."""
    return range((min(layer.pass_cryptomatte_depth, 16) + 1) // 2)


def light_group(name: str) -> str:
    """Return the light path expression of a group's light."""
    return f"C.*<L.'{tag(name)}'>"


def tag(name: str) -> str:
    """Return a light group's name as light path expressions can have it in quotes."""
    return name.replace("'", "_")


def stamp(result: Any, header: Mapping[str, str]) -> None:
    """Give a render result the names of Cryptomattes: its files have them in their headers."""
    for key, value in header.items():
        result.stamp_data_add_field(key, value)
