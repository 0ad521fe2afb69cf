"""A Ray cluster without the service: a frame in parts on its nodes, and what it is doing.

ray_parts.py    an executor of parts (primray.parts) over executor/ray
packing.py      a stage's files as a chunk has them
status.py       what a cluster says of itself
"""
