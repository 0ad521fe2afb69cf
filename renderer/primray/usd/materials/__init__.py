"""Shading networks: connections followed, nodes evaluated, textures resolved, material bindings gathered."""
