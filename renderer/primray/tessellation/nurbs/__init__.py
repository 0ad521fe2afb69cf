"""Tessellation of NURBS patches in numpy: bases, a grid of parameters, the exact surface over it, and trimming.

A patch is a tensor product, and so is its grid: every edge has the same two ends on both sides.
"""
