"""Photometry of lights: flux, illuminance, and the emission that gives a requested amount (Photometric).

Radiance is in nits per channel, lengths are in scene units. Only lights with a photometric amount use this.
"""
