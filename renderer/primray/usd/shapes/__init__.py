"""Mesh geometry and primvars in numpy: topology, triangulation, normals, subdivision cages, tessellation."""
