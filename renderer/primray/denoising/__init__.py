"""Denoised pictures beside the noisy record, by Open Image Denoise, and unbiased estimates of their error from sample halves.

`denoiser` is the only module that uses the package. `denoised` makes the picture and its report, and stops a render when the
picture is good enough: it splits a film into two independent halves and compares each denoised half with the other, noisy half.
"""
