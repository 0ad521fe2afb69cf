"""NURBS patches to triangles, in numpy: bases, a grid of parameters, the exact surface over it, and what trims cut out.

A patch is a product of two directions, and so is its grid: every edge has the same two ends on both sides.
"""
