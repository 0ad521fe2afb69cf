"""Code on a node of the cluster, in Ray's processes; a chunk itself runs in the sandboxed worker that they start.

tasks.py        everything that Ray is asked to run, and commands to running chunks
fitness.py      whether this node takes work: its versions, its CPU class, its token, its sandbox
chunk_task.py   a chunk: its files come, its worker runs, its messages and files go back
transfer.py     data that goes to a node and comes back
cache.py        contents that this node has already
"""
