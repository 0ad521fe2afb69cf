"""Colour: RGB spaces by their primaries, spectra, and display views through OpenColorIO."""
