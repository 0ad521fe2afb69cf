"""Denoised pictures beside the noisy record, by Open Image Denoise, and unbiased estimates of their error from sample halves.

`denoiser` is the only module that uses the package, and stops a render when the denoised picture is good enough. `denoised`
makes the picture and its report: it splits a film into two independent halves and compares each denoised half with the other,
noisy half.
"""
