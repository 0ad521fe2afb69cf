"""A database and its transactions: connections, locks and retries, for SQLite and PostgreSQL alike.

SQLite: readers have connections of their own and never wait (WAL); writers of this process take turns by a lock, those of
several processes by BEGIN IMMEDIATE. PostgreSQL: a pool, READ COMMITTED, and row locks. A transaction that was ended by another
or by a broken connection is retried; it is unknown then whether its commit arrived, so each transaction finds its own change
(`Transaction.previous`, and the rows themselves).

Locks are taken in one order, so that transactions wait for each other and do not deadlock: leader, scene, job, tenant; then the
sums (`flush`, sorted). Events get their numbers under the lock of their job's row: a reader of one job sees them in order.
"""

from __future__ import annotations

import hashlib
import logging
import random
import sqlite3
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

from sqlalchemy import URL, Connection, CursorResult, Engine, Executable, Table, create_engine, event, insert, make_url
from sqlalchemy.dialects.postgresql import insert as postgresql_insert
from sqlalchemy.dialects.sqlite import insert as sqlite_insert
from sqlalchemy.exc import DBAPIError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from ...jobs import Json
from ..base import Unavailable
from . import schema
from .notices import Notices

T = TypeVar("T")


class Transaction(Generic[T]):
    """A transaction. `previous`: the answer of an earlier try whose commit may have arrived; None if there was none."""

    def __init__(self, connection: Connection, previous: T | None) -> None:
        self.connection = connection
        self.previous = previous
        self.changed: list[str] = []  # ids of jobs, for subscribers
        self.to_save: list[Callable[[], object]] = []
        self._events: list[Json] = []
        self._messages = 0
        self._job_counts: Counter[tuple[str, str]] = Counter()

    def execute(self, statement: Executable, parameters: Sequence[Mapping[str, Any]] | None = None) -> CursorResult[Any]:
        found = self.connection.execute(statement, parameters) if parameters else self.connection.execute(statement)
        assert isinstance(found, CursorResult)
        return found

    def insert_new(self, table: Table, values: Mapping[str, Any]) -> bool:
        """Insert a row; return False, without a change, if it exists already."""
        return self.execute(self._insert(table).values(**values).on_conflict_do_nothing()).rowcount == 1

    def add(self, table: Table, sums: Mapping[str, float], **key: str) -> None:
        """Add to the sums in a row, creating it if necessary."""
        self.add_all(table, list(key), [{**key, **sums}])

    def add_all(self, table: Table, key: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
        """Add to several rows that have the same sums, like `add`."""
        made = self._insert(table)
        grown = {name: table.c[name] + made.excluded[name] for name in rows[0].keys() - set(key)}
        self.execute(made.on_conflict_do_update(index_elements=list(key), set_=grown), rows)

    def _insert(self, table: Table) -> Any:  # the two classes are alike, but no common one has on_conflict
        return sqlite_insert(table) if self.connection.dialect.name == "sqlite" else postgresql_insert(table)

    def event(self, job_id: str, type_: str, now: float, data: Json) -> None:
        self._events.append({"job_id": job_id, "type": type_, "created_at": now, "data": data})

    def next_message(self) -> int:
        self._messages += 1
        return self._messages

    def count_job(self, tenant: str, state: str, jobs: int) -> None:
        self._job_counts[tenant, state] += jobs

    def flush(self) -> None:
        for save in self.to_save:
            save()
        if self._events:
            self.execute(insert(schema.events), self._events)
        moved = sorted((tenant, state, jobs) for (tenant, state), jobs in self._job_counts.items() if jobs)
        if moved:
            rows = [{"tenant": tenant, "state": state, "jobs": jobs} for tenant, state, jobs in moved]
            self.add_all(schema.job_counts, ["tenant", "state"], rows)


LOG = logging.getLogger(__name__)

KEEP_TRYING_S = 45.0  # a restarting PostgreSQL server is back within half a minute
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.02, 2.0
SQLITE_BUSY_S = 10.0
MANY_ROWS = 50  # per insertion: the driver parses longer statements each time

# SQLSTATEs of PostgreSQL after which the same transaction may well succeed: connection exceptions, serialization failure,
# deadlock, lock not available, shutting down or starting up, too many connections, idle-in-transaction timeout.
PASSING_CLASSES = ("08",)
PASSING_STATES = frozenset({"40001", "40P01", "55P03", "57P01", "57P02", "57P03", "57P05", "53300", "25P03"})
PASSING_SQLITE = frozenset({sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED})


def engine_url(url: str) -> URL:
    """Return the URL with the driver to use; ValueError for another kind of database."""
    made = make_url(url)
    backend = made.get_backend_name()
    if backend in ("postgresql", "postgres"):
        return made.set(drivername="postgresql+psycopg")
    if backend == "sqlite" and made.database and made.database != ":memory:":
        return made.set(drivername="sqlite+pysqlite")
    raise ValueError(f"{made.render_as_string()} is neither sqlite:///FILE nor postgresql://...")


def is_passing(error: SQLAlchemyError) -> bool:
    """Return whether a retry may help."""
    if isinstance(error, PoolTimeout):
        return True
    if not isinstance(error, DBAPIError):
        return False
    if isinstance(error.orig, sqlite3.Error):
        return (getattr(error.orig, "sqlite_errorcode", 0) & 0xFF) in PASSING_SQLITE
    state: str | None = getattr(error.orig, "sqlstate", None)
    if state is None:  # no answer at all
        return error.connection_invalidated or type(error.orig).__name__ == "OperationalError"
    return error.connection_invalidated or state in PASSING_STATES or state.startswith(PASSING_CLASSES)


class Database:
    def __init__(self, url: str) -> None:
        self.url = engine_url(url)
        self.is_sqlite = self.url.get_backend_name() == "sqlite"
        self._turn = threading.Lock()  # serialises SQLite's writers
        self._exclusive = threading.RLock()
        self._subscribers: list[Callable[[str], None]] = []
        self._notices: Notices | None = None
        if self.is_sqlite:
            self._writer = _sqlite_engine(self.url, begin="BEGIN IMMEDIATE", connections=1)
            self._reader = _sqlite_engine(self.url, begin="BEGIN", connections=16)
        else:
            self._writer = _postgresql_engine(self.url)
            self._reader = self._writer.execution_options(isolation_level="AUTOCOMMIT")

    def close(self) -> None:
        if self._notices is not None:
            self._notices.close()
        self._reader.dispose()
        self._writer.dispose()

    def subscribe(self, on_change: Callable[[str], None]) -> Callable[[], None]:
        def called(job_id: str) -> None:  # an object of its own: one function may subscribe twice
            on_change(job_id)

        self._subscribers = [*self._subscribers, called]

        def end() -> None:
            self._subscribers = [one for one in self._subscribers if one is not called]

        return end

    def listen(self, on_notice: Callable[[Json], None]) -> None:
        """Start listening, once: subscribers then hear of other servers' changes too, and `on_told` gets their notices."""
        if not self.is_sqlite:
            self._notices = Notices(self._writer, self._tell_subscribers, on_notice)

    def tell(self, words: Json) -> None:
        if self._notices is not None:
            self._notices.tell(words)

    @contextmanager
    def exclusive(self, name: str) -> Iterator[None]:
        if self.is_sqlite:
            with self._exclusive:
                yield
            return
        key = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big", signed=True)
        with self._reader.connect() as connection:
            connection.exec_driver_sql("SELECT pg_advisory_lock(%s)", (key,))
            try:
                yield
            finally:
                connection.exec_driver_sql("SELECT pg_advisory_unlock(%s)", (key,))

    def clock(self) -> float:
        """Return seconds since 1970 on the clock of the database, independent of the servers' own."""
        if self.is_sqlite:
            return time.time()
        return self.read(lambda db: float(db.exec_driver_sql("SELECT extract(epoch FROM clock_timestamp())").scalar_one()))

    def read(self, work: Callable[[Connection], T]) -> T:
        def once(_: T | None) -> T:
            with self._reader.connect() as connection:
                return work(connection)

        return self._until_it_passes(once)

    def check(self) -> None:
        try:
            with self._reader.connect() as connection:
                connection.exec_driver_sql("SELECT fence FROM leader").all()
        except SQLAlchemyError as error:
            raise Unavailable(f"The database does not answer: {_first_line(error)}") from error

    def write(self, work: Callable[[Transaction[T]], T], *, durable: bool = True) -> T:
        """Run one transaction, retried until it succeeds. If not `durable` it may be lost in a power failure, but not when the
        process ends."""
        changed: list[str] = []

        def once(previous: T | None) -> T:
            with self._writing(durable) as connection:
                transaction = Transaction[T](connection, previous)
                answer = work(transaction)
                transaction.flush()
                changed.extend(transaction.changed)  # of all tries: each may have arrived
                try:
                    connection.commit()
                except DBAPIError as error:
                    connection.invalidate()  # it may still be in the transaction, which nobody would end
                    raise _Unsure(answer) from error
                return answer

        answer = self._until_it_passes(once)
        for job_id in dict.fromkeys(changed):
            self._tell(job_id)
        return answer

    def _tell(self, job_id: str) -> None:
        if self._notices is not None:
            self._notices.changed(job_id)
        self._tell_subscribers(job_id)

    def _tell_subscribers(self, job_id: str) -> None:
        for called in self._subscribers:
            try:
                called(job_id)
            except Exception:  # the change is committed, whatever subscribers do
                LOG.exception("a subscriber failed")

    def write_plainly(self, work: Callable[[Connection], None]) -> None:
        """Run a transaction that is repeatable as it is, and notifies nobody: for migrations."""

        def once(_: None) -> None:
            with self._writing(durable=True) as connection:
                work(connection)
                connection.commit()

        self._until_it_passes(once)

    @contextmanager
    def _writing(self, durable: bool) -> Iterator[Connection]:
        if not self.is_sqlite:
            with self._writer.connect() as connection:
                connection.begin()
                yield connection
            return
        with self._turn, self._writer.connect() as connection:
            raw = connection.connection.driver_connection
            assert isinstance(raw, sqlite3.Connection)
            # Set before the transaction: within it, it would take effect for the next one.
            raw.execute(f"PRAGMA synchronous={'FULL' if durable else 'NORMAL'}")
            connection.begin()
            yield connection

    def _until_it_passes(self, once: Callable[[T | None], T]) -> T:
        until = time.monotonic() + KEEP_TRYING_S
        pause = FIRST_PAUSE_S
        previous: T | None = None
        while True:
            try:
                return once(previous)
            except _Unsure as unsure:
                previous = unsure.answer
                error = unsure.__cause__
                assert isinstance(error, SQLAlchemyError)
            except SQLAlchemyError as caught:
                error = caught
            if not is_passing(error):
                raise error
            if time.monotonic() + pause > until:
                raise Unavailable(f"The database does not answer: {_first_line(error)}") from error
            time.sleep(pause * random.uniform(0.5, 1.0))
            pause = min(2 * pause, LONGEST_PAUSE_S)


class _Unsure(Exception):
    """The connection broke during the commit, which may have arrived."""

    def __init__(self, answer: Any) -> None:
        super().__init__()
        self.answer = answer


def _first_line(error: SQLAlchemyError) -> str:
    return str(getattr(error, "orig", None) or error).partition("\n")[0]


def _sqlite_engine(url: URL, *, begin: str, connections: int) -> Engine:
    engine = create_engine(
        url,
        pool_size=connections,
        max_overflow=0 if connections == 1 else 48,
        connect_args={"timeout": SQLITE_BUSY_S, "check_same_thread": False},
    )

    def on_connect(raw: sqlite3.Connection, _: Any) -> None:
        raw.isolation_level = None  # the driver begins no transactions: `on_begin` does
        _use_wal(raw)
        for pragma in ("foreign_keys=ON", "synchronous=FULL", "journal_size_limit=67108864"):
            raw.execute(f"PRAGMA {pragma}").fetchall()

    def on_begin(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    event.listen(engine, "connect", on_connect)
    event.listen(engine, "begin", on_begin)
    return engine


def _use_wal(raw: sqlite3.Connection) -> None:
    """Switch to WAL mode. If several processes do so at first use, all but one are refused at once, whatever their timeout, so
    it is retried."""
    until = time.monotonic() + SQLITE_BUSY_S
    while True:
        try:
            raw.execute("PRAGMA journal_mode=WAL").fetchall()
            return
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF not in PASSING_SQLITE or time.monotonic() > until:
                raise
            time.sleep(0.02)


def _postgresql_engine(url: URL) -> Engine:
    """Create an engine with timeouts, so that neither a hung server nor a hung client of ours blocks the others."""
    defaults = {
        "connect_timeout": "5",
        "application_name": "primray",
        "keepalives_idle": "10",
        "tcp_user_timeout": "20000",
        # Queries are planned each time: a plan made while a table was empty scans it when it holds 10,000 rows.
        "options": "-c lock_timeout=15s -c idle_in_transaction_session_timeout=60s -c plan_cache_mode=force_custom_plan",
    }
    connect_args = {name: value for name, value in defaults.items() if name not in url.query}
    engine = create_engine(
        url,
        pool_size=10,
        max_overflow=30,
        pool_timeout=10,
        pool_pre_ping=True,
        pool_recycle=3600,
        insertmanyvalues_page_size=MANY_ROWS,
        connect_args=connect_args,
    )
    engine.dialect.use_insertmanyvalues_wo_returning = True  # one statement for all rows, which is planned once
    return engine


class Operations:
    """Base of the operations: the database. Each method is one transaction."""

    def __init__(self, database: Database) -> None:
        self._db = database
