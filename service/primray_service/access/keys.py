"""API keys: creation, checksum and storage. Pure except for `create`, which writes to a store.

A key is "primray_", 43 characters that hold 256 random bits, "_" and a checksum of six characters: secret scanners find it, and
a truncated key is recognised as such. Only its SHA-256 is stored: for 256 random bits that is as good as a slow hash.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
import zlib
from collections.abc import Collection
from typing import TYPE_CHECKING

from ..ids import ulid
from ..limits import Quotas
from ..problems import Problem
from ..store.base import ApiKey
from .auth import SCOPES

if TYPE_CHECKING:
    from ..store.base import Store

PREFIX = "primray_"
ENTROPY_BYTES = 32
SHOWN_CHARS = len(PREFIX) + 6  # 36 of 256 bits: enough to recognise a key, useless for guessing the rest
TENANT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_FORM = re.compile(rf"({PREFIX}[A-Za-z0-9_-]{{43}})_([0-9a-z]{{6}})")


def make(entropy: bytes | None = None) -> str:
    """Return the text of a new key."""
    secret = os.urandom(ENTROPY_BYTES) if entropy is None else entropy
    if len(secret) != ENTROPY_BYTES:
        raise ValueError(f"a key has {ENTROPY_BYTES} random bytes")
    body = PREFIX + base64.urlsafe_b64encode(secret).decode().rstrip("=")
    return f"{body}_{_checksum(body)}"


def is_whole(key: str) -> bool:
    """Return whether the text has the form of a key, not truncated or mistyped; says nothing about whether it is known."""
    match = _FORM.fullmatch(key)
    return match is not None and match[2] == _checksum(match[1])


def _checksum(body: str) -> str:
    """Return 30 bits of a CRC in base 32; it guards against mistakes only."""
    digits = "0123456789abcdefghijklmnopqrstuv"
    value = zlib.crc32(body.encode()) & (1 << 30) - 1
    return "".join(digits[value >> shift & 31] for shift in range(25, -1, -5))


def new_key(
    tenant: str, scopes: Collection[str], now: float, *, name: str = "", quotas: Quotas, expires_at: float | None = None
) -> tuple[ApiKey, str]:
    """Return the key's row and its text, which is shown once; raise Problem("invalid-request") for arguments that no key can
    have."""
    unknown = set(scopes) - SCOPES
    if unknown or not scopes:
        raise Problem("invalid-request", f"scopes: choose one or more of {', '.join(sorted(SCOPES))}.", member="scopes")
    if not TENANT.fullmatch(tenant):
        raise Problem(
            "invalid-request",
            "tenant: write up to 64 letters, digits, dots, dashes and underscores, beginning with a letter.",
            member="tenant",
        )
    if expires_at is not None and expires_at <= now:
        raise Problem("invalid-request", "The key would already have expired.", member="expires_in_s")
    text = make()
    row = ApiKey(
        id=f"key_{ulid(now)}",
        tenant=tenant,
        name=name,
        prefix=text[:SHOWN_CHARS],
        sha256=hashlib.sha256(text.encode()).hexdigest(),
        scopes=frozenset(scopes),
        quotas=quotas,
        created_at=now,
        expires_at=expires_at,
    )
    return row, text


def create(
    store: Store,
    tenant: str,
    scopes: Collection[str],
    now: float,
    *,
    name: str = "",
    quotas: Quotas | None = None,
    expires_at: float | None = None,
) -> tuple[ApiKey, str]:
    """Create a key and store it: for POST /v1/keys, and for `primray keys create --data DIR`, which makes a server's first
    key."""
    row, text = new_key(tenant, scopes, now, name=name, quotas=quotas or Quotas(), expires_at=expires_at)
    store.create_key(row)
    return row, text
