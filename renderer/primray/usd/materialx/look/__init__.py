"""Looks of MaterialX documents: which materials, and what else, go to which prims of the model that chooses a look.

geometry_names.py  expressions for the paths of geometry
assignments.py     the strongest assignment of a path, and bindings in order for all paths
variants.py        values of variants on the materials of a look
effects.py         visibility and properties, written on the composed stage
looks.py           a look as a variant of /ModelRoot
"""
