"""Connection of a command to its server: address, key, and messages when it fails. Or to a data directory's store, without a
server: to create the first key, and to check that a database can be used."""

from __future__ import annotations

import os
import stat
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .exits import USAGE, CommandError, error_of
from .job_text import plain

if TYPE_CHECKING:
    from ..client import Client, ProblemError
    from ..store.base import Store


Server = Annotated[
    str | None,
    typer.Option(
        "--server", metavar="URL", help="Address of the service.", show_default="$PRIMRAY_SERVER, or http://127.0.0.1:8700"
    ),
]
KeyFile = Annotated[
    Path | None,
    typer.Option(
        "--key-file", metavar="FILE", help="File with the API key.", show_default="$PRIMRAY_API_KEY, or $PRIMRAY_API_KEY_FILE"
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON lines to stdout.")]

EXTRA = (
    "alembic",
    "httpx2",
    "prometheus_client",
    "pydantic",
    "python_multipart",
    "sqlalchemy",
    "starlette",
    "structlog",
    "uvicorn",
)
NOTED_WAIT_S = 5.0
FIRST_RETRIES = 2  # fewer before the server's first answer: a user is waiting for the error


def need_extra(command: str) -> None:
    """Raise CommandError unless the packages of `pip install primray[server]` are installed."""
    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        how = "install it with: pip install 'primray[server]'"
        raise CommandError("extra-missing", f"`primray {command}` needs the extra `server`; {how}", where=", ".join(missing))


@contextmanager
def connected(command: str, server: str | None, key_file: Path | None) -> Iterator[Client]:
    """Provide a client whose errors become the command's."""
    need_extra(command)
    from ..client import Client, ClientError, ProblemError, ServerUnreachable

    try:
        client = Client(server or None, key_of(key_file), first_retries=FIRST_RETRIES, on_wait=_noted_once())
    except ValueError as error:
        raise CommandError("server-address", str(error), USAGE) from None
    with client:
        try:
            yield client
        except ServerUnreachable as error:
            advice = "start one with `primray serve`, or give its address by --server or PRIMRAY_SERVER"
            raise CommandError("no-server", f"{error}. {advice}") from None
        except ProblemError as error:
            document = {"type": f"/problems/{error.slug}", "detail": error.detail, **error.document}
            if error.status == 401:
                document["detail"] = _about_the_key(client.has_key)
            raise error_of(document) from None
        except ClientError as error:
            raise CommandError("unexpected-answer", str(error)) from None


def _noted_once() -> Callable[[ProblemError, float], None]:
    """Return a function that reports on stderr, once for each kind of problem, that the command waits and why; short waits are
    not reported."""
    noted: set[str] = set()

    def note(problem: ProblemError, wait_s: float) -> None:
        kind = f"{problem.slug} {problem.document.get('quota', '')}"
        if wait_s >= NOTED_WAIT_S and kind not in noted:
            noted.add(kind)
            said = plain(problem.detail)
            print(
                f"waiting: {said} The request is repeated every {wait_s:.0f} s for some minutes.", file=sys.stderr, flush=True
            )

    return note


def _about_the_key(was_sent: bool) -> str:
    """Return the error about a missing or refused key in terms of the command line: the server's text is about headers."""
    if was_sent:
        return "the key was sent, and the server does not accept it: was it revoked, cut off, or made for another server?"
    how = "Set PRIMRAY_API_KEY, or name a file with the key by --key-file (or PRIMRAY_API_KEY_FILE)"
    return (
        f"the server wants an API key, and none was sent. {how}. The server's operator makes keys with `primray keys create`."
    )


def key_of(file: Path | None) -> str | None:
    """Return the API key from a file or the environment; never from the command line, which every user of the machine can
    read."""
    if file is None:
        if os.environ.get("PRIMRAY_API_KEY"):
            return os.environ["PRIMRAY_API_KEY"].strip()
        if not os.environ.get("PRIMRAY_API_KEY_FILE"):
            return None
        file = Path(os.environ["PRIMRAY_API_KEY_FILE"])
    try:
        key = file.read_text().strip()
        readable = file.stat().st_mode & (stat.S_IRGRP | stat.S_IROTH)
    except (OSError, UnicodeDecodeError) as error:
        raise CommandError("key-file", f"the key cannot be read: {error}", USAGE) from None
    if not key or len(key.split()) != 1 or not key.isascii():
        raise CommandError("key-file", f"{file} does not contain exactly one API key", USAGE)
    if readable:
        print(f"note: {file} can be read by other users of this machine; `chmod 600` it", file=sys.stderr)
    return key


Labels = Annotated[
    list[str] | None, typer.Option("--label", "-l", metavar="NAME=VALUE", help="May be repeated.", show_default=False)
]


def labels_of(texts: list[str] | None) -> dict[str, str]:
    labels = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise CommandError("label", f"--label {text}: write name=value", USAGE)
        labels[name] = value
    return labels


PATIENCE_S = 3.0


@contextmanager
def opened_store(url: str) -> Iterator[Store]:
    """Open the store, bring its schema up to date, and close it afterwards; CommandError if it cannot be used."""
    from ..store import SchemaTooNew, open_store

    # A database that is just starting is waited for: report that if it takes more than a moment.
    waiting = threading.Timer(PATIENCE_S, lambda: print("waiting for the database ...", file=sys.stderr, flush=True))
    waiting.daemon = True
    waiting.start()
    try:
        store = open_store(url)
        store.migrate()
    except SchemaTooNew as error:
        raise CommandError("database", f"{error}") from None
    except Exception as error:  # drivers raise exceptions of many types; their texts do not contain the password
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CommandError("database", f"the database cannot be used: {reason}") from None
    finally:
        waiting.cancel()
    try:
        yield store
    finally:
        store.close()
