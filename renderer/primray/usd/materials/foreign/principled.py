"""Detection of Houdini's principled shader: Solaris writes it without an id, with the operator's definition as source asset."""

from __future__ import annotations

from pxr import Sdf, Usd

from ...stage.reads import default_value

PRINCIPLED = "principledshader"
_ASSETS = ("info:sourceAsset", "info:karma:sourceAsset", "info:vex:sourceAsset", "info:VEX:sourceAsset")


def is_principled(shader: Usd.Prim) -> bool:
    """Return whether the source asset of a shader without id is a principled shader's surface, of any version."""
    for name in _ASSETS:
        attribute = shader.GetAttribute(name)
        asset = default_value(attribute) if attribute else None
        if isinstance(asset, Sdf.AssetPath) and f"/{PRINCIPLED}" in asset.path and "Displacement" not in asset.path:
            return True
    return False
