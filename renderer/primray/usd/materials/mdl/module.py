"""Which MDL module a shader is of."""

from __future__ import annotations

from pxr import Sdf

from ...querying.guarded import default_value
from ..network import Node


def module_of(shader: Node) -> str:
    """Its path, "" where it is of none."""
    asset = default_value(shader.prim.GetAttribute("info:mdl:sourceAsset"))
    return str(asset.path) if isinstance(asset, Sdf.AssetPath) else ""
