"""Pinned pictures: a lock file with all that a picture's bits depend on and hashes of them, and its verification elsewhere.

difference.py   a difference between what was and what is; data sets have the same
things.py       digests of what reaches the core, by prim: equal means equal pixels, whatever the files
inputs.py       the files and settings that pixels depend on, named relative to the stage's folder
lock.py         the lock file, and the seal of each of its sections
attestation.py  a signed statement about a pinned picture (in-toto, DSSE)
pinning.py      `pin`: render a picture and write its lock
verification.py `verify`: find the first difference, and say what is proven
"""
