# SPDX-License-Identifier: GPL-3.0-or-later
"""primray as a render engine of Blender.

`engine.py` is what Blender calls, `interface.py` what users see; `usd_export/` runs in a background Blender and `renderer.py`
in the Python that has primray, both started by `processes.py`.
"""

from __future__ import annotations

import bpy

from . import engine, interface


def register() -> None:
    interface.register()
    bpy.utils.register_class(engine.PrimraySaveStage)
    bpy.utils.register_class(engine.PrimrayEngine)


def unregister() -> None:
    bpy.utils.unregister_class(engine.PrimrayEngine)
    bpy.utils.unregister_class(engine.PrimraySaveStage)
    interface.unregister()
    engine.KEPT.end()
