"""Lenses: distortion and diffusion as data, held by `camera` (part of the description)."""
