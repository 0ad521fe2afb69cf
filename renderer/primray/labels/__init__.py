"""Ground truth of labelled prims: ids of classes and of things, what is seen of each, and where it is.

A thing is a prim with labels of its own in a taxonomy, as often as it is in the world. `table` has the ids of classes,
`things` the record of one thing, `view` the AOVs and the report's entries of a render.
"""

from .table import LabelTable
from .things import Thing
from .view import labels_of_view

__all__ = ["LabelTable", "Thing", "labels_of_view"]
