"""Scenes as they are sent: streamed to the disk, recognised, a zip unpacked, kept under the digest of their bytes.

    digests.py        Content-Digest and Repr-Digest (RFC 9530)
    receive.py        a body, or a multipart form, to files in incoming/, counting bytes
    multipart.py      the parts of a form as they arrive
    recognize.py      what kind of file it is, by its first bytes; names for display
    zip_directory.py  a zip's members, as its central directory and its local headers agree on
    zip_names.py      which names and kinds of members are refused
    unpack.py         a zip to a folder, counting what comes out
    entries.py        which layers of a package can be its root
    staging.py        folders for uploads under way
    preparing.py      a staged upload made ready to be kept; the lock of scenes/
    keep.py           from incoming/ to scenes/<hex> and into the store; removal
    shared.py         the same, where servers share an object store; cache.py: the copies that each has of it
    threads.py        blocking work that is always waited for

Nothing here parses USD or decodes an image: that is the worker's check, in its sandbox.
"""
