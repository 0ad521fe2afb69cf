"""Attributes that the MaterialX reader leaves on the prims it makes from a document, where USD has no words for them."""

from __future__ import annotations

NOTES = "primray:materialx:notes"  # messages about parts of the document that have no effect on the prim
LOOK = "primray:materialx:look"  # the variant that chose a look which does more than bind materials
DEFAULT_NODE = "primray_materialx_default"  # customData of an input: the node below its prim that gives what it has by default
