"""Skinning by USD itself (UsdSkel) on a copy of the stage: bindings, pose times, normals, instances."""
