"""Rendering: `render` has the whole sequence on one page, `prepare` what precedes the first sample, `products` several renders.

The package shares its name with the function `primray.render`. Importing it is cheap: expensive modules are imported when a
render starts.
"""

from ..report.prepared import Prepared
from .prepare import OpenedStage, Steps, check_memory, image_sizes, load_textures, open_once, prepare
from .render import OnInterrupt, core_facts, find_aovs, picture_of, render, rendered_frames

__all__ = [
    "OnInterrupt",
    "OpenedStage",
    "Prepared",
    "Steps",
    "check_memory",
    "core_facts",
    "find_aovs",
    "image_sizes",
    "load_textures",
    "open_once",
    "picture_of",
    "prepare",
    "render",
    "rendered_frames",
]
