"""Storage of pictures in files: bit depths, EXR parts and headers."""
