"""Meshes and primvars as numbers: topology, triangles, normals, cages, tessellation."""
