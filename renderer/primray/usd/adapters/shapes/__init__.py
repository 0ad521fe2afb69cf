"""UsdGeom: one file a kind of shape."""
