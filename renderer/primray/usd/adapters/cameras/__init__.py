"""UsdGeomCamera: its window and lens, shutter and clipping."""
