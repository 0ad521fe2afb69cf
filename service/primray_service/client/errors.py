"""What the client raises.

ClientError
  ServerUnreachable   nobody answers, after all tries
  ProblemError        the server answered with a problem document
  UnexpectedAnswer    what answered is no such service, or one that this client does not understand
  DigestMismatch      a file arrived with other bytes than the server said
  TimedOut            what was waited for did not happen in time
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
    """`document` is the problem as the server sent it (RFC 9457); `slug` is the end of its type, such as "not-found"."""

    def __init__(self, status: int, document: Mapping[str, Any], retry_after_s: float | None = None) -> None:
        self.status = status
        self.document = dict(document)
        self.slug = str(document.get("type", "about:blank")).removeprefix("/problems/")
        self.detail = str(document.get("detail") or document.get("title") or f"status {status}")
        self.retry_after_s = retry_after_s
        super().__init__(f"{self.slug}: {self.detail}")
