"""Lens diffusion: convolution of the rendered linear image, and its errors, with a point spread function of unit energy.

`psf` adds the kernels of `glare`, `bloom` and `starburst`, `convolve` applies it, and `diffuse` does both for an image.
"""
