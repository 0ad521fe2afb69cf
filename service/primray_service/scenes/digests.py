"""Digests of a body (RFC 9530): those that the client sent, computed while the bytes pass, and compared at the end."""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import re
from collections.abc import Mapping

from ..problems import Problem

HEADERS = ("Content-Digest", "Repr-Digest")
ALGORITHMS = {"sha-256": "sha256", "sha-512": "sha512"}  # the algorithms that RFC 9530, section 5, calls active
# A dictionary member of RFC 8941: key=:base64:; parameters are allowed and ignored.
MEMBER = re.compile(r"\s*([a-z*][a-z0-9_.*-]*)=:([A-Za-z0-9+/=]*):\s*(?:;[^,]*)?")


class BodyDigests:
    """The digests that came with a body. Algorithms other than sha-256 and sha-512 are ignored, as the RFC asks."""

    def __init__(self, headers: Mapping[str, str]) -> None:
        self._expected: list[tuple[str, str, bytes]] = []
        for header in HEADERS:
            if header in headers:
                self._expected += [(header, name, digest) for name, digest in _parse(header, headers[header])]
        self._hashes = {name: hashlib.new(ALGORITHMS[name]) for _, name, _ in self._expected}

    def update(self, data: bytes) -> None:
        for sum_ in self._hashes.values():
            sum_.update(data)

    def check(self) -> None:
        for header, name, digest in self._expected:
            computed = self._hashes[name].digest()
            if not hmac.compare_digest(computed, digest):
                raise Problem(
                    "digest-mismatch",
                    f"{header} says {name} {encoded(digest)}; what arrived has {encoded(computed)}. Send it again.",
                    header=header,
                    computed=f"{name}=:{encoded(computed)}:",
                )


def sha256_header(hexadecimal: str) -> str:
    """Return the value of Repr-Digest for a file with this SHA-256."""
    return f"sha-256=:{encoded(bytes.fromhex(hexadecimal))}:"


def encoded(digest: bytes) -> str:
    return base64.b64encode(digest).decode()


def _parse(header: str, value: str) -> list[tuple[str, bytes]]:
    found = []
    for member in value.split(","):
        match = MEMBER.fullmatch(member)
        if match is None:
            raise Problem("invalid-request", f"{header} is not in the form of RFC 9530: sha-256=:<base64>:", header=header)
        name, text = match.groups()
        if name in ALGORITHMS:
            try:
                digest = base64.b64decode(text, validate=True)
            except binascii.Error:
                digest = b""
            if len(digest) != hashlib.new(ALGORITHMS[name]).digest_size:
                raise Problem("invalid-request", f"{header}: this is not a {name} digest in base64", header=header)
            found.append((name, digest))
    return found
