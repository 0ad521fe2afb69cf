"""Reading and validation of NurbsPatch prims: basis directions, weights and trim curves, with reports of what does not fit."""
