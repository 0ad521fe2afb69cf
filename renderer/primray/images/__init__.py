"""Pictures and their files: the image, the outputs beside it, EXR parts and product names."""
