"""Requests to the service: repeated where that is safe, with the delay that the server asks for; errors become exceptions.

Requests that may be repeated after a lost answer: GET, HEAD, DELETE, and those that the caller declares idempotent (an upload
by its digest, a job by its Idempotency-Key). A request that was refused with 429 or 503, or whose connection was never made,
was not carried out and is repeated, unless the problem says that it is not retryable.

Server-sent events (https://html.spec.whatwg.org/multipage/server-sent-events.html) are parsed line by line.
"""

from __future__ import annotations

import ipaddress
import json
import random
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

import httpx2

from primray import __version__

from ..http.retry_after import retry_after_s
from .documents import Event, Json
from .errors import ProblemError, ServerUnreachable, UnexpectedAnswer

RETRIED_STATUSES = frozenset({429, 502, 503, 504})
REPEATABLE = frozenset({"GET", "HEAD", "DELETE"})
FIRST_DELAY_S = 0.25
LONGEST_DELAY_S = 20.0
LONGEST_WAIT_S = 120.0  # longest delay accepted from a server; beyond it the error is raised
MOST_ERROR_BYTES = 2**20


class Transport:
    """Connection to a service. `retries`: tries after the first; `sleep` takes seconds; `on_wait` is called with a problem and
    the seconds until the request is sent again."""

    def __init__(
        self,
        server: str,
        key: str | None,
        *,
        retries: int,
        timeout_s: float,
        first_retries: int | None = None,
        sleep: Callable[[float], None] = time.sleep,
        on_wait: Callable[[ProblemError, float], None] | None = None,
    ) -> None:
        self.server = server.rstrip("/")
        url = httpx2.URL(self.server)
        if url.scheme not in ("http", "https") or not url.host:
            raise ValueError(f"{server!r} is not a server's address; write one like http://127.0.0.1:8700")
        self._retries = retries
        self._first_retries = retries if first_retries is None else first_retries
        self._has_answered = False
        self._sleep = sleep
        self._on_wait = on_wait
        headers = {"User-Agent": f"primray-client/{__version__}"} | ({"Authorization": f"Bearer {key}"} if key else {})
        self._http = httpx2.Client(
            base_url=self.server,
            headers=headers,
            timeout=httpx2.Timeout(timeout_s, connect=min(10.0, timeout_s)),
            trust_env=not _is_loopback(url.host),  # a proxy cannot reach this machine's loopback
        )

    def close(self) -> None:
        self._http.close()

    def request(
        self,
        method: str,
        path: str,
        *,
        params: Mapping[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
        body: Any = None,
        content: Callable[[], Iterator[bytes]] | None = None,
        repeatable: bool | None = None,
        timeout_s: float | None = None,
        accept: frozenset[int] = frozenset(),
    ) -> httpx2.Response:
        """Return the answer, with its body read; ProblemError unless it is 2xx or in `accept`. `content` creates the body for
        each try."""
        headers = dict(headers or {})
        if body is not None:
            headers["Content-Type"] = "application/json"
        may_repeat = method in REPEATABLE if repeatable is None else repeatable
        for tries in range(self._retries + 1):
            sent = json.dumps(body).encode() if body is not None else content() if content is not None else None
            timeout = httpx2.Timeout(timeout_s, connect=10.0) if timeout_s is not None else httpx2.USE_CLIENT_DEFAULT
            try:
                answer = self._http.request(method, path, params=params, headers=headers, content=sent, timeout=timeout)
            except httpx2.TransportError as error:
                self._wait_or_raise(tries, _unreachable(self.server, error), not_sent(error) or may_repeat, None)
                continue
            # an earlier try, whose answer was lost, deleted it
            was_deleted = method == "DELETE" and answer.status_code == 404 and tries > 0
            self._has_answered = True
            if answer.status_code < 300 or answer.status_code in accept or was_deleted:
                return answer
            problem = problem_of(answer)
            again = answer.status_code in (429, 503) or (may_repeat and answer.status_code in RETRIED_STATUSES)
            again = again and not _is_final(problem)
            self._wait_or_raise(tries, problem, again, getattr(problem, "retry_after_s", None))
        raise AssertionError("the last try returned or raised")

    @contextmanager
    def stream(
        self, path: str, headers: Mapping[str, str], *, timeout_s: float, params: Mapping[str, Any] | None = None
    ) -> Iterator[httpx2.Response]:
        """Provide the answer to a GET for streaming, tried once; ServerUnreachable also if reading breaks off."""
        timeout = httpx2.Timeout(timeout_s, connect=10.0)
        try:
            with self._http.stream("GET", path, headers=dict(headers), params=params, timeout=timeout) as answer:
                self._has_answered = True
                if answer.status_code >= 300 and answer.status_code != 416:
                    read_error(answer)
                    raise problem_of(answer)
                yield answer
        except httpx2.TransportError as error:
            raise _unreachable(self.server, error) from None

    def patiently(self, tries: int, error: Exception) -> None:
        """Wait before the next try of a stream, or raise the error after the last try or if a retry would not help."""
        if isinstance(error, ProblemError):
            self._wait_or_raise(tries, error, error.status in RETRIED_STATUSES and not _is_final(error), error.retry_after_s)
        else:
            self._wait_or_raise(tries, error, isinstance(error, ServerUnreachable), None)

    def _wait_or_raise(self, tries: int, error: Exception, again: bool, asked_s: float | None) -> None:
        most = self._retries if self._has_answered else self._first_retries
        if not again or tries >= most or (asked_s or 0.0) > LONGEST_WAIT_S:
            raise error
        delay = min(LONGEST_DELAY_S, FIRST_DELAY_S * 2**tries) * random.uniform(0.5, 1.0)
        wait_s = max(delay, asked_s or 0.0)
        if self._on_wait is not None and isinstance(error, ProblemError):
            self._on_wait(error, wait_s)
        self._sleep(wait_s)


def _is_final(error: Exception) -> bool:
    """Return whether the server says that the same request will fail again."""
    return isinstance(error, ProblemError) and error.document.get("retryable") is False


def not_sent(error: httpx2.TransportError) -> bool:
    return isinstance(error, httpx2.ConnectError | httpx2.ConnectTimeout | httpx2.PoolTimeout)


def read_error(answer: httpx2.Response) -> None:
    """Read the body of an error if it is small; a large one is not an error document."""
    if int(answer.headers.get("Content-Length", 0) or 0) <= MOST_ERROR_BYTES:
        answer.read()


def problem_of(answer: httpx2.Response) -> ProblemError | UnexpectedAnswer:
    asked = retry_after_s(answer.headers, time.time())
    try:
        document = answer.json() if answer.request.method != "HEAD" else {}
    except (ValueError, httpx2.ResponseNotRead):
        document = None
    is_problem = isinstance(document, dict) and (str(document.get("type", "")).startswith("/problems/") or document == {})
    if is_problem or answer.status_code in RETRIED_STATUSES:
        return ProblemError(answer.status_code, document if isinstance(document, dict) else {}, asked)
    return UnexpectedAnswer(f"{answer.request.url} answered {answer.status_code}, but not like a primray service")


def _unreachable(server: str, error: httpx2.TransportError) -> ServerUnreachable:
    reason = str(error) or type(error).__name__
    return ServerUnreachable(f"no answer from {server}: {reason}")


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def job_path(job_id: str) -> str:
    return f"/v1/jobs/{quote(job_id, safe='')}"


def json_of(answer: Any) -> Any:
    try:
        return answer.json()
    except ValueError:
        raise UnexpectedAnswer(f"{answer.request.url} answered {answer.status_code} without JSON") from None


def object_of(document: Any) -> Json:
    if not isinstance(document, dict):
        raise UnexpectedAnswer("a JSON object was expected")
    return document


def items_of(page: Any) -> list[Any]:
    items = page.get("items") if isinstance(page, dict) else page
    if not isinstance(items, list):
        raise UnexpectedAnswer("a list was expected")
    return items


LONGEST_DATA = 4 * 2**20


@dataclass
class Reading:
    """State that a reconnect needs: the last event's id, and the delay before reconnecting."""

    last_id: int | None = None
    retry_s: float = 1.0
    _type: str = ""
    _id: str = ""
    _data: list[str] = field(default_factory=list)
    _size: int = 0

    def events(self, parts: Iterable[bytes]) -> Iterator[Event]:
        """Yield the events of one connection; an event that is cut off is dropped, as the standard says."""
        self._forget()
        for line in _lines(parts):
            if line:
                self._take(line)
            elif self._data:
                event = self._event()
                self._forget()
                if event is not None:
                    self.last_id = event.id or self.last_id
                    yield event
            else:
                self._forget()

    def _take(self, line: str) -> None:
        name, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if name == "event":
            self._type = value
        elif name == "id" and "\0" not in value:
            self._id = value
        elif name == "retry" and value.isascii() and value.isdigit():
            self.retry_s = min(60.0, int(value[:9]) / 1000)
        elif name == "data":
            self._size += len(value)
            if self._size > LONGEST_DATA:
                raise UnexpectedAnswer("an event is larger than any that this client expects")
            self._data.append(value)

    def _event(self) -> Event | None:
        """Return the event, or None if it has no id, since a reconnect could not resume after it; positions in the queue have
        id 0."""
        if self._type == "queue" and not self._id:
            self._id = "0"
        if not (self._id.isascii() and self._id.isdigit()):
            return None
        try:
            data = json.loads("\n".join(self._data))
        except ValueError:
            raise UnexpectedAnswer(f"event {self._id} is not JSON") from None
        return Event(int(self._id), self._type or "message", data if isinstance(data, dict) else {"value": data})

    def _forget(self) -> None:
        self._type, self._id, self._data, self._size = "", "", [], 0


def _lines(parts: Iterable[bytes]) -> Iterator[str]:
    """Yield lines ended by LF or CR LF. str.splitlines is not suitable: it also splits at characters such as U+2028 within
    JSON."""
    rest = b""
    for part in parts:
        *whole, rest = (rest + part).split(b"\n")
        if len(rest) > LONGEST_DATA:
            raise UnexpectedAnswer("a line of the events is longer than any that this client expects")
        for line in whole:
            yield line.removesuffix(b"\r").decode("utf-8", "replace")
