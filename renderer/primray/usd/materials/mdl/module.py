"""MDL modules of shaders."""

from __future__ import annotations

from pxr import Sdf

from ...stage.reads import default_value
from ..network import Node


def module_of(shader: Node) -> str:
    """Return the path of a shader's MDL module, "" where it has none."""
    asset = default_value(shader.prim.GetAttribute("info:mdl:sourceAsset"))
    return str(asset.path) if isinstance(asset, Sdf.AssetPath) else ""
