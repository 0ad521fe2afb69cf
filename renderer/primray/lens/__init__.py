"""Imperfections of lenses, as numbers: part of a camera."""
