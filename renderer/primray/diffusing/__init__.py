"""Diffusion in a lens: a point spread function of unit energy, on the linear picture after the render, with its error.

`psf` puts together what `glare`, `bloom` and `starburst` make of the lens's numbers, `convolve` spreads light by it, and
`diffuse` is both for an image.
"""
