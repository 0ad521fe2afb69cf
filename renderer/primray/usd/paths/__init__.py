"""Attributes over the shutter: how points, instances, radii and lights move by what is authored."""
