"""Surface nodes that are known by name, one file per model, each read into a KnownSurface (record.py).

by_name.py lists the models; as_open_pbr.py converts a KnownSurface to a Surface, and alone decides what has no effect.
"""
