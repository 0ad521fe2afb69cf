"""Uploaded scenes: streamed to the disk, recognised, zips unpacked, stored under the digest of their bytes.

    digests.py        Content-Digest and Repr-Digest (RFC 9530)
    receive.py        a body, or a multipart form, to files in incoming/, counting bytes
    recognize.py      the kind of a file by its first bytes; names for display
    zip_directory.py  a zip's members, on which its central directory and its local headers must agree
    zip_names.py      names and kinds of members that are refused
    entries.py        which layers of a package can be its root
    staging.py        folders for uploads in progress
    preparing.py      a staged upload made ready to be stored, zips unpacked; the lock of scenes/
    keep.py           from incoming/ to scenes/<hex> and into the store; removal
    shared.py         the same for servers that share an object store; each server's local copies
    threads.py        blocking work that is always waited for

Nothing here parses USD or decodes an image: that is the worker's check, in its sandbox.
"""
