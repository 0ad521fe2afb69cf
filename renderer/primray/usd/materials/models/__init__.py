"""Surface models, each read into a KnownSurface (open_pbr.py), which is converted to a Surface with OpenPBR's lobes.

surface_nodes.py has the table of MaterialX surface shaders, and the shaders that need only a few lines.
"""
