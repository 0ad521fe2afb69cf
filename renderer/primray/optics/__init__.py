"""Lenses: how they distort. A part of the seam, that `camera` holds."""
