"""Cryptomattes: ids of the objects that cover each pixel, and their coverage."""
