"""Authored motion of attributes over the shutter: points, instances, radii and lights."""
