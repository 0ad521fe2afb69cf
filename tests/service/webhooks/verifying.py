"""A receiver's check of a webhook, written from the specification's text and not from the sender's code."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
from collections.abc import Mapping
from typing import Any

TOLERANCE_S = 300


def verified(headers: Mapping[str, str], body: bytes, secret: str, now: float) -> Any:
    """The body's JSON; ValueError if it is not the sender's or too old."""
    lowered = {name.lower(): value for name, value in headers.items()}
    stamp = lowered["webhook-timestamp"]
    if abs(now - int(stamp)) > TOLERANCE_S:
        raise ValueError("too old, or of the future")
    hasher = hmac.new(base64.b64decode(secret[len("whsec_") :]), digestmod=hashlib.sha256)
    hasher.update(lowered["webhook-id"].encode() + b"." + stamp.encode() + b"." + body)
    expected = hasher.digest()
    for one in lowered["webhook-signature"].split(" "):
        version, _, encoded = one.partition(",")
        if version == "v1" and hmac.compare_digest(base64.b64decode(encoded), expected):
            return json.loads(body)
    raise ValueError("no signature is right")
