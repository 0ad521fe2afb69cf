"""Colour: RGB spaces by their primaries, and the views of displays through OpenColorIO."""
