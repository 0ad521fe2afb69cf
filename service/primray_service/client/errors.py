"""Exceptions that the client raises.

ClientError
  ServerUnreachable   no answer after all retries
  ProblemError        the server answered with a problem document
  UnexpectedAnswer    the answer is not that of a primray service, or this client does not understand it
  DigestMismatch      the bytes of a received file do not have the server's digest
  TimedOut            the awaited change did not happen in time
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class ClientError(Exception):
    pass


class ServerUnreachable(ClientError):
    pass


class UnexpectedAnswer(ClientError):
    pass


class DigestMismatch(ClientError):
    pass


class TimedOut(ClientError):
    pass


class ProblemError(ClientError):
    """A problem document from the server (RFC 9457) as `document`; `slug` is the end of its type, such as "not-found"."""

    def __init__(self, status: int, document: Mapping[str, Any], retry_after_s: float | None = None) -> None:
        self.status = status
        self.document = dict(document)
        self.slug = str(document.get("type", "about:blank")).removeprefix("/problems/")
        self.detail = str(document.get("detail") or document.get("title") or f"status {status}")
        self.retry_after_s = retry_after_s
        super().__init__(f"{self.slug}: {self.detail}")
