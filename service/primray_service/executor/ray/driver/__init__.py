"""The process that talks to Ray for a server, on the same machine; `python -m primray_service.executor.ray.driver`.

    __main__.py     lines from and to the server
    cluster.py      connecting to the cluster, or why not; its nodes, which of them take work, and how many chunks fit;
                    chunks of other drivers (`primray farm status`)
    contents.py     files on their way to nodes: stored once in the object store, by content hash
    given_chunk.py  a chunk that was given to a node, and its files that come back

It ends when the server does, and when Ray ends it because the cluster is gone.
"""
