"""A picture and its files: the image, the outputs beside it, EXR parts and the names of products."""
