"""Chunks on the nodes of a Ray cluster.

    executor.py    what the dispatcher has: a RayExecutor; run.py: one of its chunks
    link.py        the process that speaks to Ray for it, seen from the server
    protocol.py    what the two say to each other
    driver/        that process
    node/          what runs on the cluster's nodes: a chunk in a task, in the same sandboxed worker as on one machine

The server itself never imports ray: Ray ends the process that has lost its cluster, and unpickles what the cluster sends.
"""
