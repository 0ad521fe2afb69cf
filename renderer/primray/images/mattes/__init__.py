"""Cryptomattes: ids of what covers each pixel, and by how much."""
