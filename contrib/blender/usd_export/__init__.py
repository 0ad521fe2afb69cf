# SPDX-License-Identifier: GPL-3.0-or-later
"""From a Blender scene to a USD stage, in a background Blender of its own: `process.py` is what runs there.

Blender's USD exporter writes shapes and materials. Lights, world and cameras, which it writes otherwise than they are in
Blender, are written here as a layer over them, and so are instances.
"""
