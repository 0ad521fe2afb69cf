"""API keys: how one is made, told from a mistyped one, and stored. Pure but for `create`, which puts it into a store.

A key is "primray_", 43 characters that hold 256 random bits, "_" and six that are a checksum: secret scanners find it, and a
key that was cut off while copying can be told so. Only its SHA-256 is kept: of 256 random bits that is as good as a slow hash.
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
SHOWN_CHARS = len(PREFIX) + 6  # 36 bits of 256: enough to recognise it by, useless to guess the rest
TENANT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_FORM = re.compile(rf"({PREFIX}[A-Za-z0-9_-]{{43}})_([0-9a-z]{{6}})")


def make(entropy: bytes | None = None) -> str:
    """A new key's text."""
    secret = os.urandom(ENTROPY_BYTES) if entropy is None else entropy
    if len(secret) != ENTROPY_BYTES:
        raise ValueError(f"a key has {ENTROPY_BYTES} random bytes")
    body = PREFIX + base64.urlsafe_b64encode(secret).decode().rstrip("=")
    return f"{body}_{_checksum(body)}"


def is_whole(key: str) -> bool:
    """Whether it is a key as `make` makes them, not cut off or mistyped; says nothing of whether it is known."""
    match = _FORM.fullmatch(key)
    return match is not None and match[2] == _checksum(match[1])


def _checksum(body: str) -> str:
    """30 bits of a CRC, in base 32: only against mistakes."""
    digits = "0123456789abcdefghijklmnopqrstuv"
    value = zlib.crc32(body.encode()) & (1 << 30) - 1
    return "".join(digits[value >> shift & 31] for shift in range(25, -1, -5))


def new_key(
    tenant: str, scopes: Collection[str], now: float, *, name: str = "", quotas: Quotas, expires_at: float | None = None
) -> tuple[ApiKey, str]:
    """The row, and the text that is shown once; Problem("invalid-request") for what no key can be."""
    unknown = set(scopes) - SCOPES
    if unknown or not scopes:
        raise Problem("invalid-request", f"scopes: one or more of {', '.join(sorted(SCOPES))}.", member="scopes")
    if not TENANT.fullmatch(tenant):
        raise Problem(
            "invalid-request",
            "tenant: up to 64 letters, digits, dots, dashes and underscores, a letter first.",
            member="tenant",
        )
    if expires_at is not None and expires_at <= now:
        raise Problem("invalid-request", "The key would have expired already.", member="expires_in_s")
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
    """Make a key and store it: POST /v1/keys, and `primray keys create --data DIR` for the first one of a server."""
    row, text = new_key(tenant, scopes, now, name=name, quotas=quotas or Quotas(), expires_at=expires_at)
    store.create_key(row)
    return row, text
