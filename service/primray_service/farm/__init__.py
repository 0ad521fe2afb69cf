"""A Ray cluster without the service: parts of a frame on its nodes, and the state of the cluster.

ray_parts.py    an executor of parts (primray.distributed) based on executor/ray, with a stage's files as inputs of a chunk
status.py       state of a cluster
"""
