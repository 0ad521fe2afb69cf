"""UsdGeomCamera and the view: choice of the camera, lens, shutter, motion, back plates and automatic cameras."""
