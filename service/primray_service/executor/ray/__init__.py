"""Chunks on the nodes of a Ray cluster.

    executor.py    RayExecutor, for the dispatcher, and its chunks
    link.py        the driver process, seen from the server
    protocol.py    messages between the two
    driver/        the driver process, which talks to Ray
    node/          code on the cluster's nodes: a chunk in a Ray task, in the same sandboxed worker as on one machine

The server itself never imports ray: Ray ends a process that has lost its cluster, and unpickles what the cluster sends.
"""
