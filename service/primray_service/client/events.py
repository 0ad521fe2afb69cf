"""Server-sent events (https://html.spec.whatwg.org/multipage/server-sent-events.html), parsed line by line."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from .documents import Event
from .errors import UnexpectedAnswer

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
