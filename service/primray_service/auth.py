"""Authentication: API keys, and sessions that stand in for a key where no header can be sent (EventSource, <img>).

This module knows no HTTP; http/callers.py reads requests. A session is a signed cookie: it survives a restart of the server, is
checked against its key on every use, and ends at logout.

A key is "primray_", 43 characters that hold 256 random bits, "_" and a checksum of six characters: secret scanners find it, and
a truncated key is recognised as such. Only its SHA-256 is stored: for 256 random bits that is as good as a slow hash.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import os
import re
import threading
import time
import zlib
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from .ids import ulid
from .limits import Quotas
from .problems import Problem
from .store.base import ApiKey

if TYPE_CHECKING:
    from .store.base import Store


SCOPES = frozenset({"submit", "read", "admin"})
LOCAL_TENANT = "local"
SESSION_S = 12 * 3600.0
KEY_AGE_S = 2.0  # upper bound of the time until a key revoked by another server is refused
KEYS_KEPT = 1024


@dataclass(frozen=True)
class Caller:
    """The sender of a request; `key` is None where none is needed (on loopback)."""

    tenant: str
    scopes: frozenset[str]
    key: ApiKey | None = None

    def allows(self, scope: str) -> bool:
        """Return whether the caller has this scope; an admin has all of them within its tenant."""
        return scope in self.scopes or "admin" in self.scopes

    def quotas(self, default: Quotas) -> Quotas:
        return default if self.key is None else self.key.quotas


LOCAL = Caller(LOCAL_TENANT, SCOPES)


def sha256_of(key: str) -> str:
    return hashlib.sha256(key.encode("utf-8", "surrogateescape")).hexdigest()


class Keys:
    """Keys by their hash, cached for a moment so that most requests do not read them from the store. Thread-safe."""

    def __init__(self, find: Callable[[str], ApiKey | None]) -> None:
        self._find = find
        self._known: dict[str, tuple[float, ApiKey | None]] = {}
        self._lock = threading.Lock()

    def remembered(self, sha256: str) -> tuple[ApiKey | None, bool]:
        """Return the cached key, and whether the cache knows the answer (None is an answer, too)."""
        known = self._known.get(sha256)
        if known is None or time.monotonic() - known[0] > KEY_AGE_S:
            return None, False
        return known[1], True

    def key(self, sha256: str) -> ApiKey | None:
        found = self._find(sha256)
        with self._lock:
            if len(self._known) >= KEYS_KEPT:
                self._known.clear()
            self._known[sha256] = (time.monotonic(), found)
        return found

    def forget(self) -> None:
        """Drop the cached keys, so that a key revoked here is refused at once."""
        with self._lock:
            self._known.clear()


def caller_of(key: ApiKey | None, now: float) -> Caller:
    """Return the caller for a key that is valid now, else raise Problem; every invalid key gets the same words."""
    if key is None or key.revoked_at is not None or (key.expires_at is not None and key.expires_at <= now):
        raise unauthenticated("This API key is unknown, revoked or expired.")
    return Caller(key.tenant, key.scopes, key)


def unauthenticated(detail: str) -> Problem:
    return Problem("unauthenticated", detail, headers={"www-authenticate": 'Bearer realm="primray"'})


class Sessions:
    """Session cookies: `<random id>.<sha256 of the key>.<end time>.<signature>`. `ended` records logouts for all servers; its
    answers are cached for a moment."""

    def __init__(self, secret: bytes, ended: EndedSessions) -> None:
        self._secret = secret
        self._ended = ended
        self._known: dict[str, tuple[float, bool]] = {}  # by session: when the store was asked, and whether it has ended
        self._lock = threading.Lock()

    def begin(self, key_sha256: str, now: float) -> str:
        body = f"{os.urandom(16).hex()}.{key_sha256}.{int(now + SESSION_S)}"
        return f"{body}.{self._signature(body)}"

    def key_sha256(self, cookie: str, now: float) -> str | None:
        """Return the SHA-256 of the session's key, or None if the session is invalid or has ended. May block on the store: see
        `is_known`."""
        found = self._read(cookie, now)
        if found is None or self._has_ended(found[0]):
            return None
        return found[1]

    def is_known(self, cookie: str) -> bool:
        """Return whether `key_sha256` answers without reading the store."""
        known = self._known.get(cookie.partition(".")[0])
        return known is not None and (known[1] or time.monotonic() - known[0] <= KEY_AGE_S)

    def end(self, cookie: str, now: float) -> None:
        """End the session. Blocks on the store."""
        found = self._read(cookie, now)
        if found is not None and not self._has_ended(found[0]):
            self._ended.end_session(found[0], found[2], now)
            self._remember(found[0], True)

    def _read(self, cookie: str, now: float) -> tuple[str, str, float] | None:
        """Return the session, its key's SHA-256 and its end time, or None if we did not sign the cookie or it has expired."""
        body, _, signature = cookie.rpartition(".")
        if not hmac.compare_digest(signature.encode(), self._signature(body).encode()):
            return None
        session, sha256, ends = body.split(".")
        return None if int(ends) <= now else (session, sha256, float(ends))

    def _has_ended(self, session: str) -> bool:
        known = self._known.get(session)
        if known is not None and (known[1] or time.monotonic() - known[0] <= KEY_AGE_S):
            return known[1]
        has_ended = self._ended.session_has_ended(session)
        self._remember(session, has_ended)
        return has_ended

    def _remember(self, session: str, has_ended: bool) -> None:
        with self._lock:
            if len(self._known) >= KEYS_KEPT:
                self._known.clear()
            self._known[session] = (time.monotonic(), has_ended)

    def _signature(self, body: str) -> str:
        return hmac.new(self._secret, body.encode("utf-8", "surrogateescape"), hashlib.sha256).hexdigest()


class EndedSessions(Protocol):
    """The part of a store that sessions need."""

    def end_session(self, session: str, until: float, now: float) -> None: ...

    def session_has_ended(self, session: str) -> bool: ...


def session_secret(file: Path) -> bytes:
    """Return the secret that signs sessions, creating it at first use; servers that share a data directory share it."""
    draft = file.with_name(f"{file.name}.{os.urandom(6).hex()}")
    if not file.exists():
        handle = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "wb") as out:
            out.write(os.urandom(32))
            out.flush()
            os.fsync(out.fileno())
        try:
            os.link(draft, file)  # if two servers do this at once, the first wins
        except FileExistsError:
            pass
        finally:
            draft.unlink()
    secret = file.read_bytes()
    if len(secret) != 32:
        raise ValueError(f"{file} does not hold 32 bytes; remove it to create a new one, which ends all sessions")
    return secret


KEY_PREFIX = "primray_"
ENTROPY_BYTES = 32
SHOWN_CHARS = len(KEY_PREFIX) + 6  # 36 of 256 bits: enough to recognise a key, useless for guessing the rest
TENANT_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_FORM = re.compile(rf"({KEY_PREFIX}[A-Za-z0-9_-]{{43}})_([0-9a-z]{{6}})")


def make_key(entropy: bytes | None = None) -> str:
    """Return the text of a new key."""
    secret = os.urandom(ENTROPY_BYTES) if entropy is None else entropy
    if len(secret) != ENTROPY_BYTES:
        raise ValueError(f"a key has {ENTROPY_BYTES} random bytes")
    body = KEY_PREFIX + base64.urlsafe_b64encode(secret).decode().rstrip("=")
    return f"{body}_{_checksum(body)}"


def is_whole_key(key: str) -> bool:
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
    if not TENANT_NAME.fullmatch(tenant):
        raise Problem(
            "invalid-request",
            "tenant: write up to 64 letters, digits, dots, dashes and underscores, beginning with a letter.",
            member="tenant",
        )
    if expires_at is not None and expires_at <= now:
        raise Problem("invalid-request", "The key would already have expired.", member="expires_in_s")
    text = make_key()
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


def issue_key(
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
