"""A real PostgreSQL server for tests: the one at $PRIMRAY_TEST_POSTGRES, or a private one that lives as long as the session.

    from tests.service.postgres import postgres_databases, postgres_server, postgres_url    (fixtures: import all three)

`postgres_url` is a migrated, empty database for each test.
"""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from primray_service.store import open_store

START_S = 60.0


def programs() -> Path | None:
    """The folder with initdb: of the newest version that is there."""
    found = shutil.which("initdb")
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: float(path.parent.name))
    return Path(found).parent if found else next((path for path in reversed(folders) if (path / "initdb").exists()), None)


@dataclass
class Server:
    """`admin_url`: of a database in which others may be made. `folder` is None for a server that is not ours."""

    admin_url: str
    folder: Path | None = None
    bin: Path | None = None

    def execute(self, statement: str) -> list[tuple[object, ...]]:
        import psycopg

        with psycopg.connect(self.admin_url.replace("+psycopg", ""), autocommit=True) as connection:
            found = connection.execute(statement.encode())
            return found.fetchall() if found.description else []

    def url_of(self, database: str) -> str:
        from sqlalchemy import make_url

        return make_url(self.admin_url).set(database=database).render_as_string(hide_password=False)

    def new_database(self) -> str:
        name = f"primray_{uuid.uuid4().hex[:12]}"
        self.execute(f"CREATE DATABASE {name} TEMPLATE template0")
        return name

    def drop(self, database: str) -> None:
        self.execute(f"DROP DATABASE IF EXISTS {database} WITH (FORCE)")

    def kill_connections(self, database: str) -> int:
        """As an administrator does, or a server that goes down."""
        of_it = f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{database}'"
        return len(self.execute(of_it))

    def stop(self, mode: str = "fast") -> None:
        """`immediate`: without writing anything, as after a crash."""
        self._control("stop", "-m", mode)

    def start(self) -> None:
        self._control("start", "-l", f"{self.folder}/log", "-w", "-t", str(int(START_S)))

    def _control(self, *words: str) -> None:
        assert self.bin is not None
        _run_plain([str(self.bin / "pg_ctl"), "-D", f"{self.folder}/data", *words])


@dataclass
class Databases:
    """Making one takes 0.4 s on a busy machine, emptying one 0.07 s: so they are used again."""

    server: Server
    free: list[str] = field(default_factory=list)
    all: list[str] = field(default_factory=list)

    def take(self) -> str:
        return self.free.pop() if self.free else self._new()

    def _new(self) -> str:
        name = self.server.new_database()
        self.all.append(name)
        store = open_store(self.server.url_of(name))
        store.migrate()
        store.close()
        return name

    def give_back(self, name: str) -> None:
        """As it was when it was new: schema.py's tables are empty, but for the leader's row."""
        import psycopg

        self.server.kill_connections(name)
        with psycopg.connect(self.server.url_of(name).replace("+psycopg", ""), autocommit=True) as connection:
            tables = connection.execute("SELECT tablename FROM pg_tables WHERE schemaname = 'public'").fetchall()
            names = ", ".join(table for (table,) in tables if table != "alembic_version")
            connection.execute(f"TRUNCATE {names} RESTART IDENTITY".encode())
            connection.execute("INSERT INTO leader (id, fence, holder, acquired_at, expires_at) VALUES (1, 0, NULL, 0, 0)")
        self.free.append(name)

    def drop_all(self) -> None:
        """Of a server that is not ours; ours goes with all it holds."""
        for name in self.all if self.server.folder is None else []:
            self.server.drop(name)


def _run_plain(command: list[str]) -> None:
    """As a user that PostgreSQL accepts: not root."""
    if os.geteuid() == 0:
        command = ["runuser", "-u", "postgres", "--", *command]
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=START_S * 2
    )
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout.decode(errors='replace')}")


def _has_user(name: str) -> bool:
    try:
        pwd.getpwnam(name)
    except KeyError:
        return False
    return True


@contextmanager
def private_server() -> Iterator[Server]:
    """On a socket in a folder of its own: no port is taken, nobody else finds it."""
    binaries = programs()
    if binaries is None or (os.geteuid() == 0 and not (_has_user("postgres") and shutil.which("runuser"))):
        pytest.skip("skipped: no PostgreSQL")
    folder = Path(tempfile.mkdtemp(prefix="primray-pg-", dir="/tmp"))
    server = Server(f"postgresql+psycopg://postgres@/postgres?host={folder}", folder, binaries)
    try:
        if os.geteuid() == 0:
            shutil.chown(folder, "postgres")
        locale = ("--encoding=UTF8", "--locale=C", "--auth=trust", "--username=postgres", "--no-sync")
        _run_plain([str(binaries / "initdb"), "-D", f"{folder}/data", *locale])
        settings = (
            f"listen_addresses=''\nunix_socket_directories='{folder}'\nmax_connections=200\nshared_buffers=32MB\nfsync=off\n"
        )
        with (folder / "data" / "postgresql.conf").open("a") as file:
            file.write(settings)
        server.start()
        yield server
    finally:
        _end(server)


def _end(server: Server) -> None:
    assert server.folder is not None
    pid_file = server.folder / "data" / "postmaster.pid"
    if pid_file.exists():
        pid = int(pid_file.read_text().split()[0])
        os.kill(pid, signal.SIGQUIT)  # at once: its data are not wanted
        until = time.monotonic() + 20
        while Path(f"/proc/{pid}").exists() and time.monotonic() < until:
            time.sleep(0.02)
    shutil.rmtree(server.folder, ignore_errors=True)


_running: list[Server] = []  # wherever the fixture is imported to, there is one server


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[Server]:
    given = os.environ.get("PRIMRAY_TEST_POSTGRES")
    if given:
        from primray_service.store.database.engine import engine_url

        yield Server(engine_url(given).render_as_string(hide_password=False))
    elif _running:
        yield _running[0]
    else:
        with private_server() as server:
            _running.append(server)
            yield server
            _running.clear()


@pytest.fixture(scope="session")
def postgres_databases(postgres_server: Server) -> Iterator[Databases]:
    databases = Databases(postgres_server)
    yield databases
    databases.drop_all()


@pytest.fixture
def postgres_url(postgres_databases: Databases) -> Iterator[str]:
    """Of a database that is migrated and empty."""
    name = postgres_databases.take()
    yield postgres_databases.server.url_of(name)
    postgres_databases.give_back(name)
