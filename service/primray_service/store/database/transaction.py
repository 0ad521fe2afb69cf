"""A transaction that changes something, with its sums at the end and its notifications.

Locks are taken in one order, so that transactions wait for each other and do not deadlock: leader, scene, job, tenant; then the
sums (`flush`, sorted). Events get their numbers under the lock of their job's row: a reader of one job sees them in order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from sqlalchemy import Connection, CursorResult, Executable, Table, insert
from sqlalchemy.dialects.postgresql import insert as postgresql_insert
from sqlalchemy.dialects.sqlite import insert as sqlite_insert

from ...jobs import Json
from . import schema

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
