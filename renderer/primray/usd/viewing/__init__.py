"""The view: choice of the camera, resolution of its image, shutter and camera motion."""
