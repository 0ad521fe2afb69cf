"""primray renders USD stages on CPUs and returns images with their error. `usd` translates, `render` runs the core.

What needs numpy is imported when it is first asked for, so that the command line starts quickly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .errors import PrimrayError
from .render import render, render_frames
from .settings import Filter, RenderSettings
from .version import __version__

if TYPE_CHECKING:
    from .checkpoints.checkpointing import Checkpointing
    from .description import Camera
    from .images.image import Image
    from .render.products import Product, render_products

__all__ = [
    "Camera",
    "Checkpointing",
    "Filter",
    "Image",
    "PrimrayError",
    "Product",
    "RenderSettings",
    "__version__",
    "render",
    "render_frames",
    "render_products",
]


def __getattr__(name: str) -> Any:
    if name == "Image":
        from .images.image import Image

        return Image
    if name == "Checkpointing":
        from .checkpoints.checkpointing import Checkpointing

        return Checkpointing
    if name == "Camera":
        from .description import Camera

        return Camera
    if name in ("Product", "render_products"):
        from .render import products

        return getattr(products, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
