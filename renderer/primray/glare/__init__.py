"""Diffusion of the rendered linear image, and its errors, by its camera's lens: veiling glare, bloom and starburst.

`psf` makes the point spread function of unit energy, `diffuse` convolves an image with it.
"""
