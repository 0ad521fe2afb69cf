"""Cryptomatte's hashes of names."""

from __future__ import annotations

import numpy as np

from primray.images.cryptomatte import hash_of, murmur_hash


def test_hashes_are_the_specifications() -> None:
    """Known values of MurmurHash3_x86_32; no id is an infinity, a NaN or a number below the usual ones."""
    assert murmur_hash(b"") == 0
    assert murmur_hash(b"hello") == 0x248BFA47
    assert murmur_hash(b"hello, world") == 0x149BBB7F
    floats = np.array([hash_of(str(n)) for n in range(20_000)], np.uint32).view(np.float32)
    assert np.isfinite(floats).all()
    assert (np.abs(floats) >= np.finfo(np.float32).tiny).all()
