"""Denoised pictures beside the record, by Open Image Denoise, and what their errors are: estimated without bias from halves.

`denoiser` is the gate to the package; `halves` takes the two independent halves of a film apart, `cross_half` compares each
denoised half with the other as it is, `denoised` makes the picture and what a report says of it, `target` stops a render by it.
"""
