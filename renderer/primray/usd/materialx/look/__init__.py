"""Looks of MaterialX documents: which materials, visibility and properties the prims of a model get.

geometry_names.py: expressions for paths of geometry. assignments.py: the strongest assignment of a path, and ordered bindings
for all paths. variants.py: variant values on the materials of a look. effects.py: visibility and properties, written on the
composed stage. looks.py: a look as a variant of /ModelRoot.
"""
