"""`primray serve`: a render service on this machine, with nothing else installed."""

from __future__ import annotations

import hashlib
import ipaddress
import os
import shlex
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from . import limit_options
from .connection import need_extra
from .exits import USAGE, CommandError, problems_as_errors
from .farm import RayCores, RayLabel

if TYPE_CHECKING:
    from ..config import ServeConfig


def _print_limits(asked: bool) -> None:
    if asked:
        print("\n".join(limit_options.lines()))
        raise typer.Exit


def serve(
    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address to listen on. Any but loopback requires keys and a sandbox.")
    ] = ("127.0.0.1"),
    port: Annotated[int, typer.Option(metavar="N", help="Port; 0: any free one.", min=0, max=65535)] = 8700,
    data: Annotated[
        str | None,
        typer.Option(
            metavar="DIR|URL",
            help="Data directory: a folder, or an object store (s3://bucket/prefix, by primray[objects]).",
            show_default="$PRIMRAY_DATA, or a folder of this user",
        ),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="With an object store: folder for working files and copies.",
            show_default="$PRIMRAY_CACHE, or a folder of this user",
        ),
    ] = None,
    database: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Database, such as postgresql+psycopg://user@host/name.",
            show_default="$PRIMRAY_DATABASE, or SQLite in DIR",
        ),
    ] = None,
    slots: Annotated[
        int | None, typer.Option(metavar="N", help="Number of concurrent renders.", show_default="by the cores", min=1)
    ] = None,
    cores: Annotated[
        int | None, typer.Option(metavar="N", help="Cores for all renders together.", show_default="all", min=1)
    ] = None,
    executor: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Where renders run: this machine (local) or a cluster (ray).", show_default="local"),
    ] = None,
    ray_address: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT", help="Address of the Ray cluster's head.", show_default="auto, this machine's cluster"
        ),
    ] = None,
    ray_cores: RayCores = None,
    ray_label: RayLabel = None,
    ray_check_tiles: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Tiles of each part that this machine renders again, as it does not trust the nodes; all but parts runs here.",
            show_default="nodes are trusted",
            min=1,
        ),
    ] = None,
    shared_root: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=DIR",
            help="Shared storage whose stages jobs may name as shared:NAME/path.usda; read-only; may be repeated.",
            show_default=False,
        ),
    ] = None,
    shared_tenants: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=TENANT,...", help="Tenants that may use the shared root; may be repeated.", show_default="all tenants"
        ),
    ] = None,
    require_keys: Annotated[bool, typer.Option("--require-keys", help="Require keys on loopback, too.")] = False,
    allow_unsandboxed: Annotated[
        bool, typer.Option("--allow-unsandboxed", help="Serve even if the sandbox does not work here: for trusted users only.")
    ] = False,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Change a limit, such as upload_bytes=4G; may be repeated.", show_default=False
        ),
    ] = None,
    limits: Annotated[
        bool, typer.Option("--limits", callback=_print_limits, is_eager=True, help="List all limits that --limit can change.")
    ] = False,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Host name that the service answers to; may be repeated.", show_default=False),
    ] = None,
    allow_origin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ORIGIN",
            help="Origin of another site whose pages may use the API (CORS), such as https://portal.example; may be repeated.",
            show_default=False,
        ),
    ] = None,
    webhook_network: Annotated[
        list[str] | None,
        typer.Option(metavar="CIDR", help="A private network that webhooks may call; may be repeated.", show_default=False),
    ] = None,
    webhook_http: Annotated[bool, typer.Option("--webhook-http", help="Allow webhooks without TLS.")] = False,
    no_dispatch: Annotated[bool, typer.Option("--no-dispatch", help="Answer requests, but do not render.")] = False,
    open_metrics: Annotated[bool, typer.Option("--open-metrics", help="Serve /metrics without a key.")] = False,
    log: Annotated[
        Literal["json", "text"] | None, typer.Option(help="Format of the log.", show_default="text on a terminal, else json")
    ] = None,
) -> None:
    """Start a render service: an HTTP API and a page. Ctrl-C stops it; jobs continue when it is started again."""
    need_extra("serve")
    from ..config import ServeConfig
    from ..executor.base import DEFAULT_EXECUTOR
    from ..shared_roots import roots_of

    check_networks(webhook_network or [])
    where = executor or os.environ.get("PRIMRAY_EXECUTOR") or DEFAULT_EXECUTOR
    ray = check_ray(
        where,
        {
            "--ray-address": ray_address,
            "--ray-cores": ray_cores,
            "--ray-label": ray_label,
            "--ray-check-tiles": ray_check_tiles,
        },
    )
    folder, objects = places(data, cache)
    chosen_limits, quotas = limit_options.limits_of(limit or [])
    config = ServeConfig(
        data=folder,
        objects=objects,
        host=host,
        port=port,
        database=database or os.environ.get("PRIMRAY_DATABASE") or None,
        limits=chosen_limits,
        quotas=quotas,
        executor=where,
        shared_roots=roots_of(shared_root or (), shared_tenants or ()),
        slots=slots,
        cores=cores,
        ray_address=ray_address or (os.environ.get("PRIMRAY_RAY_ADDRESS") if ray else None) or "auto",
        ray_cores=ray_cores,
        ray_labels=tuple(ray_label or ()),
        ray_check_tiles=ray_check_tiles,
        require_keys=True if require_keys else None,
        allow_unsandboxed=allow_unsandboxed,
        allowed_hosts=tuple(allow_host or ()),
        allowed_origins=tuple(allow_origin or ()),
        dispatch=not no_dispatch,
        metrics_key=not open_metrics,
        webhook_networks=tuple(webhook_network or ()),
        webhook_http=webhook_http,
        log_json=log == "json" or (log is None and not sys.stderr.isatty()),
    )
    run(config)


def run(config: ServeConfig) -> None:
    from ..server import serve as run_server

    print(f"data in {config.objects or config.data}", file=sys.stderr, flush=True)
    with problems_as_errors():
        prepare(config)
        run_server(config)


def prepare(config: ServeConfig) -> None:
    """Check before the server starts that the data directory and the database can be used; print how to create a key."""
    from ..files import DataDirectory
    from .connection import opened_store

    try:
        DataDirectory(config.data).create()
    except OSError as error:
        raise CommandError(
            "data-directory", f"{config.data} cannot be used: {error.strerror}; choose one with --data"
        ) from None
    with opened_store(config.database_url) as store:
        if config.needs_keys and not store.keys():
            where = "" if config.objects else f"--data {shlex.quote(str(config.data))} "
            where += "--database ... " if config.database else ""  # may contain a password
            print(f"no API key exists yet; create the first one: primray keys create {where}--scopes admin", file=sys.stderr)


def check_networks(networks: list[str]) -> None:
    for text in networks:
        try:
            ipaddress.ip_network(text)
        except ValueError as error:
            raise CommandError("webhook-network", f"--webhook-network {text}: {error}", USAGE) from None


def check_ray(executor: str, flags: Mapping[str, object]) -> bool:
    """Return whether the executor is a Ray cluster; CommandError for flags of another executor, or if ray is not installed."""
    if executor == "ray":
        if find_spec("ray") is None:
            how = "install it with: pip install 'primray[ray]'"
            raise CommandError("ray-missing", f"`--executor ray` needs the extra `ray`; {how}")
        return True
    given = [name for name, value in flags.items() if value is not None]
    if given:
        raise CommandError("usage", f"{', '.join(given)} requires --executor ray", USAGE)
    return False


def places(data: str | None, cache: Path | None) -> tuple[Path, str | None]:
    """Return the data folder, and the URL of the object store if --data or $PRIMRAY_DATA names one; raises CommandError."""
    said = data or os.environ.get("PRIMRAY_DATA") or ""
    if "://" not in said:
        if cache is not None:
            raise CommandError("usage", "--cache requires an object store: --data s3://bucket/prefix", USAGE)
        return Path(said) if said else default_data(), None
    if find_spec("fsspec") is None:
        raise CommandError("objects-missing", f"--data {said} needs the extra `objects`; pip install 'primray[objects]'")
    named = cache or (Path(os.environ["PRIMRAY_CACHE"]) if os.environ.get("PRIMRAY_CACHE") else None)
    below = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "primray"
    return named or below / hashlib.sha256(said.encode()).hexdigest()[:16], said


def default_data() -> Path:
    """Return $PRIMRAY_DATA, else the system's usual folder for a user's data."""
    if os.environ.get("PRIMRAY_DATA"):
        return Path(os.environ["PRIMRAY_DATA"])
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "primray"
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "primray"
