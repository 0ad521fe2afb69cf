"""UsdGeomCamera: window, lens, lens distortion, shutter and clipping."""
