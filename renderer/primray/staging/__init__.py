"""What a user has added beside the stage: a studio light, a dome, a ground, a camera that is turned around.

All of it changes the description that translation made, before textures are loaded and shapes diced. The stage is not edited,
so that nothing which refers to its prims (light links, collections, instances) can change. Each addition is reported as
`staging`, and the studio light as `default-light`.
"""

from .additions import require_dome, staged
from .judged_light import with_studio_where_dark

__all__ = ["require_dome", "staged", "with_studio_where_dark"]
