"""Shading networks: connections followed, nodes read, textures resolved, bindings gathered."""
