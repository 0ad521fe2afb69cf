"""Lenses: how they distort, and their imperfections, as numbers. A part of the seam, which `camera` holds."""
