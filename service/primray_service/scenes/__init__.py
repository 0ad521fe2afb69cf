"""Uploaded scenes: streamed to the disk, recognised, zips unpacked, stored under the digest of their bytes.

    receive.py        a body, or a multipart form, to files in incoming/, counting bytes; digests (RFC 9530)
    recognize.py      the kind of a file by its first bytes; names for display; layers of a package that can be its root
    zip_directory.py  a zip's members: its central directory and its local headers must agree; names and kinds that are refused
    contents.py       packages that are uploaded by content: their files, by digest
    staging.py        folders for uploads in progress; blocking work that is always waited for
    preparing.py      a staged upload made ready to be stored, zips unpacked; the lock of scenes/
    keep.py           from incoming/ to scenes/<hex> and into the store; removal
    shared.py         the same for servers that share an object store; each server's local copies

Nothing here parses USD or decodes an image: that is the worker's check, in its sandbox.
"""
