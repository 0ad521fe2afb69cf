"""The process that speaks to Ray for a server, on the same machine; `python -m primray_service.executor.ray.driver`.

    __main__.py     its lines, from and to the server
    connection.py   to the cluster, and why there is none
    cluster.py      which nodes there are and which of them take work; room.py: how many chunks fit (pure)
    contents.py     files on their way to nodes: once into the object store, by content hash
    given_chunk.py  a chunk that a node has
    received.py     files that come back
    running.py      what other drivers' chunks do, for `primray farm status`

It ends when the server does, and when Ray ends it because the cluster is gone.
"""
