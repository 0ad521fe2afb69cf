"""NURBS patches and curves: reading and validation of prims, and their adapters."""
