"""Adapters for UsdGeom shapes, one file for each kind of shape."""
