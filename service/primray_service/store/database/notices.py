"""Notices between servers on one PostgreSQL: changed jobs, and short messages (NOTIFY, LISTEN).

Delivery is quick but not guaranteed: a server that was not connected misses notices, so all servers poll as well. Notices are
sent after the commit, several in one: a NOTIFY inside the transaction would make commits wait for each other.
"""

from __future__ import annotations

import json
import logging
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from sqlalchemy import Engine

from ...ids import ulid
from ...jobs import Json

if TYPE_CHECKING:
    import psycopg

LOG = logging.getLogger(__name__)

CHANNEL = "primray"
MOST_BYTES = 7000  # of a notice: PostgreSQL's limit is 8,000
MOST_WAITING = 10_000  # unsent; more are dropped
LOOK_EVERY_S = 1.0  # interval of checks whether it should end
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.1, 5.0

Told = tuple[str, Json | None]  # a job's id, or "" and a message


class Notices:
    """Sender and receiver of notices. `on_change` and `on_told` are called with other servers' notices, in a thread of its
    own."""

    def __init__(self, engine: Engine, on_change: Callable[[str], None], on_notice: Callable[[Json], None]) -> None:
        self._engine = engine
        self._on_change = on_change
        self._on_told = on_notice
        self._me = ulid(0.0)[10:]
        self._waiting: queue.Queue[Told] = queue.Queue(MOST_WAITING)
        self._unsent: list[Told] = []  # taken, and maybe lost with a connection
        self._closing = threading.Event()
        self.is_listening = threading.Event()
        for name, work in (("notices-out", self._send), ("notices-in", self._listen)):
            threading.Thread(target=self._again_and_again, args=(work,), name=name, daemon=True).start()

    def changed(self, job_id: str) -> None:
        self._put((job_id, None))

    def tell(self, words: Json) -> None:
        self._put(("", words))

    def close(self) -> None:
        self._closing.set()
        self._put(("", None))

    def _put(self, told: Told) -> None:
        try:
            self._waiting.put_nowait(told)
        except queue.Full:
            LOG.warning("notices to other servers are dropped: the database is slow")

    def _again_and_again(self, work: Callable[[psycopg.Connection], None]) -> None:
        """Run the work on a connection, and on another one whenever that breaks."""
        pause = FIRST_PAUSE_S
        while not self._closing.is_set():
            try:
                with self._connected() as connection:
                    work(connection)
                pause = FIRST_PAUSE_S
            except Exception as error:
                if not self._closing.is_set():
                    LOG.warning("notices between servers are interrupted: %r", error)
            self._closing.wait(pause)
            pause = min(2 * pause, LONGEST_PAUSE_S)

    @contextmanager
    def _connected(self) -> Iterator[psycopg.Connection]:
        """Take a connection out of the pool, which replaces it."""
        with self._engine.connect() as pooled:
            pooled.detach()
            raw: Any = pooled.connection.dbapi_connection
            raw.rollback()
            raw.autocommit = True
            try:
                yield raw
            except BaseException:
                pooled.invalidate()
                raise

    def _send(self, connection: psycopg.Connection) -> None:
        while not self._closing.is_set():
            self._unsent = self._unsent or [self._waiting.get()]
            while not self._waiting.empty():
                self._unsent.append(self._waiting.get_nowait())
            for payload in self._payloads(self._unsent):
                connection.execute("SELECT pg_notify(%s, %s)", (CHANNEL, payload))
            self._unsent = []

    def _payloads(self, told: Sequence[Told]) -> Iterator[str]:
        for words in (words for _, words in told if words is not None):
            yield json.dumps({"from": self._me, "words": words})
        jobs: list[str] = []
        for job_id in dict.fromkeys(job_id for job_id, _ in told if job_id):
            jobs.append(job_id)
            if sum(len(each) + 4 for each in jobs) > MOST_BYTES:
                yield json.dumps({"from": self._me, "jobs": jobs})
                jobs = []
        if jobs:
            yield json.dumps({"from": self._me, "jobs": jobs})

    def _listen(self, connection: psycopg.Connection) -> None:
        try:
            connection.execute(f"LISTEN {CHANNEL}".encode())
            self.is_listening.set()
            while not self._closing.is_set():
                for notice in connection.notifies(timeout=LOOK_EVERY_S):
                    self._hear(notice.payload)
        finally:
            self.is_listening.clear()

    def _hear(self, payload: str) -> None:
        try:
            heard = json.loads(payload)
            if heard["from"] == self._me:
                return
            for job_id in heard.get("jobs", ()):
                self._on_change(job_id)
            if "words" in heard:
                self._on_told(heard["words"])
        except Exception:  # a malformed notice must not end the listening
            LOG.exception("a notice was not understood")
