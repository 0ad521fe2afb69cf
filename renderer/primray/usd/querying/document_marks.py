"""What MaterialX documents leave on the prims that they become parts of, beside what USD has words for."""

from __future__ import annotations

NOTES = "primray:materialx:notes"  # messages: what the document says of the prim and nothing does
LOOK = "primray:materialx:look"  # the variant that chose a look which does more than bind materials
DEFAULT_NODE = "primray_materialx_default"  # customData of an input: the node below its prim that gives what it has by default
