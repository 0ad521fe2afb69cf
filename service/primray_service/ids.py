"""Identifiers: ULIDs, which sort by creation time (https://github.com/ulid/spec)."""

from __future__ import annotations

import os

ALPHABET = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"


def ulid(now: float, entropy: bytes | None = None) -> str:
    """Return 26 characters: 48 bits of milliseconds since 1970, 80 random bits."""
    value = int(now * 1000) << 80 | int.from_bytes(os.urandom(10) if entropy is None else entropy)
    return "".join(ALPHABET[value >> shift & 31] for shift in range(125, -1, -5))


def job_id(now: float) -> str:
    return f"job_{ulid(now)}"
