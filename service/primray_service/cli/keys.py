"""`primray keys`: API keys, over HTTP with an admin's key; `create` also works on a data directory, for the first key."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Server, connected, need_extra
from .exits import USAGE, CommandError, problems_as_errors
from .job_text import plain

keys = typer.Typer(
    help="Make, list and revoke API keys.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

SCOPES = ("submit", "read", "admin")


@keys.command()
def create(
    tenant: Annotated[
        str, typer.Option(metavar="NAME", help="Tenant whose jobs and scenes the key gives access to.")
    ] = "local",
    name: Annotated[str, typer.Option(metavar="TEXT", help="Display name of the key.", show_default=False)] = "",
    scopes: Annotated[str, typer.Option(metavar="LIST", help="Scopes: submit, read, admin.")] = "submit,read",
    days: Annotated[float | None, typer.Option(metavar="N", help="Validity in days.", show_default="for ever")] = None,
    data: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write to this data directory, without a server.", show_default=False)
    ] = None,
    database: Annotated[
        str | None, typer.Option(metavar="URL", help="Write to this database, without a server.", show_default=False)
    ] = None,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """Create a key and print it, once: only its digest is stored."""
    wanted = [scope.strip() for scope in scopes.split(",") if scope.strip()]
    if not wanted or set(wanted) - set(SCOPES):
        raise CommandError("scopes", f"--scopes {scopes}: choose from {', '.join(SCOPES)}", USAGE)
    if days is not None and not 0 < days <= 36_500:
        raise CommandError("days", "--days must be a number above 0", USAGE)
    seconds = None if days is None else days * 86_400
    if data is not None or database is not None:
        key_id, text = _create_offline(data, database, tenant, name, wanted, seconds)
    else:
        with connected("keys", server, key_file) as client:
            made = client.create_key(tenant, name=name, scopes=wanted, expires_in_s=seconds)
        key_id, text = made.id, made.key or ""
    if json:
        print_line({"type": "key", "id": key_id, "tenant": tenant, "name": name, "scopes": wanted, "key": text})
        return
    print(text)
    print(f"{key_id} for tenant {tenant}: {', '.join(wanted)}. The key is shown only once; keep it safe.", file=sys.stderr)


def _create_offline(
    data: Path | None, database: str | None, tenant: str, name: str, scopes: Sequence[str], seconds: float | None
) -> tuple[str, str]:
    need_extra("keys")
    from ..auth import issue_key
    from ..config import ServeConfig
    from ..files import DataDirectory
    from .connection import opened_store

    folder = data if data is not None else Path(".")
    if data is not None:
        DataDirectory(folder).create()
    now = time.time()
    with problems_as_errors(), opened_store(ServeConfig(folder, database=database).database_url) as store:
        row, text = issue_key(store, tenant, scopes, now, name=name, expires_at=None if seconds is None else now + seconds)
    return row.id, text


@keys.command("list")
def list_keys(server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """List all keys, without their text."""
    with connected("keys", server, key_file) as client:
        rows = [("KEY", "TENANT", "SCOPES", "BEGINS", "CREATED", "STATE", "NAME")]
        for key in client.list_keys():
            state = "revoked" if key.revoked_at else f"until {key.expires_at:%Y-%m-%d}" if key.expires_at else "valid"
            if json:
                facts = {"id": key.id, "tenant": key.tenant, "name": key.name, "prefix": key.prefix, "scopes": key.scopes}
                print_line({"type": "key", **facts, "state": state})
            created = f"{key.created_at:%Y-%m-%d}" if key.created_at else ""
            rows.append((key.id, plain(key.tenant), ",".join(key.scopes), key.prefix, created, state, plain(key.name)))
    if not json:
        widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
        for row in rows:
            print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


@keys.command()
def revoke(
    key: Annotated[str, typer.Argument(metavar="KEY", help="A key's id, as in the list.", show_default=False)],
    server: Server = None,
    key_file: KeyFile = None,
) -> None:
    """Refuse a key from now on."""
    with connected("keys", server, key_file) as client:
        client.revoke_key(key)
    print(f"{key} revoked")
