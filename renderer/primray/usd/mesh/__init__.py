"""Polygonal meshes, subdivision surfaces and tetrahedral meshes: reading, validation, triangulation, motion."""
