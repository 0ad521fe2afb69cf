"""Secrets and signatures of the Standard Webhooks scheme: HMAC-SHA256 over id.timestamp.body, keys written as whsec_<base64>.

https://github.com/standard-webhooks/standard-webhooks/blob/main/spec/standard-webhooks.md
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import secrets

PREFIX = "whsec_"
KEY_BYTES = range(24, 65)  # lengths that the scheme allows
MADE_KEY_BYTES = 32


def new_secret() -> str:
    return PREFIX + base64.b64encode(secrets.token_bytes(MADE_KEY_BYTES)).decode()


def key_of(secret: str) -> bytes:
    """Return the bytes of a secret; ValueError says what is wrong with it."""
    if not secret.startswith(PREFIX):
        raise ValueError(f"A secret must start with {PREFIX}.")
    try:
        key = base64.b64decode(secret.removeprefix(PREFIX), validate=True)
    except (binascii.Error, ValueError):
        raise ValueError(f"What follows {PREFIX} is not base64.") from None
    if len(key) not in KEY_BYTES:
        raise ValueError(f"A secret must have {KEY_BYTES[0]} to {KEY_BYTES[-1]} bytes; this one has {len(key)}.")
    return key


def signed_headers(secret: str, message_id: str, timestamp: int, body: bytes) -> dict[str, str]:
    """Return the three headers of one attempt; `timestamp` is the attempt's, in seconds since 1970."""
    signed = b".".join((message_id.encode(), str(timestamp).encode(), body))
    signature = base64.b64encode(hmac.digest(key_of(secret), signed, hashlib.sha256)).decode()
    return {"webhook-id": message_id, "webhook-timestamp": str(timestamp), "webhook-signature": f"v1,{signature}"}
