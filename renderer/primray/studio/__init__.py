"""Additions to a stage that the user's settings ask for: studio light, dome, ground, camera orbit.

They change the translated description, before textures are loaded and shapes are diced. The stage is not edited, so that
nothing that refers to its prims (light links, collections, instances) can change. Each addition is reported as `staging`, the
studio light as `default-light`.
"""

from .additions import require_dome, with_requested_additions, with_studio_where_dark

__all__ = ["require_dome", "with_requested_additions", "with_studio_where_dark"]
