"""Configuration of `primray serve`; checked when created."""

from __future__ import annotations

import ipaddress
import os
import re
from dataclasses import dataclass, field
from pathlib import Path

from primray.errors import SettingsError

from .executor.base import DEFAULT_EXECUTOR, check_executor_name
from .limits import Limits, Quotas
from .shared_roots import SharedRoots

# Label of a Ray node: a name, optionally with a domain before it, and a value.
LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._/-]*=[A-Za-z0-9][A-Za-z0-9._-]*")

# Origin as browsers write it: lower case, with a port only if it is not the scheme's default.
ORIGIN = re.compile(r"https?://([a-z0-9.-]+|\[[0-9a-f:.]+\])(:[0-9]{1,5})?")


@dataclass(frozen=True)
class ServeConfig:
    """Configuration of a server; it listens at `host` and `port` (0: any free port)."""

    data: Path
    # Object store that several servers share in place of the folder `data`: any URL that fsspec opens.
    objects: str | None = None
    host: str = "127.0.0.1"
    port: int = 8700
    # SQLAlchemy URL (sqlite:///... or postgresql+psycopg://...); None: SQLite in the data directory.
    database: str | None = None
    limits: Limits = field(default_factory=Limits)
    quotas: Quotas = field(default_factory=Quotas)  # for tenants whose keys set none
    shared_roots: SharedRoots = field(default_factory=SharedRoots)  # shared storage whose stages jobs may name
    slots: int | None = None  # concurrent renders; None: one for every eight cores
    executor: str = DEFAULT_EXECUTOR  # name in the table of executor/base.py
    cores: int | None = None  # None: all that this process may use
    # Ray executor: the cluster (HOST:PORT, or auto: the one this machine belongs to), cores of a node for each render (None: 8,
    # or all of the smallest node's), and labels, NAME=VALUE, that nodes must have.
    ray_address: str = "auto"
    ray_cores: int | None = None
    ray_labels: tuple[str, ...] = ()
    # Tiles of each part that this machine renders again before it believes a node; None: nodes are trusted.
    ray_check_tiles: int | None = None
    require_keys: bool | None = None  # None: unless it listens on loopback
    allow_unsandboxed: bool = False
    allowed_hosts: tuple[str, ...] = ()  # names that the server answers for, beside its own address
    allowed_origins: tuple[str, ...] = ()  # origins of pages elsewhere whose scripts may use the API (CORS)
    dispatch: bool = True  # whether this server may hold the dispatcher's lease
    metrics_key: bool = True  # /metrics needs an admin key if keys are required
    webhook_networks: tuple[str, ...] = ()  # private networks that webhooks may call, for tests and closed networks
    webhook_http: bool = False  # webhooks may use plain http
    warm: bool = True  # keep idle workers ready
    log_json: bool = True

    def __post_init__(self) -> None:
        """Validate the executor, labels and origins; raises SettingsError."""
        check_executor_name(self.executor)
        if self.objects is not None and self.database is None:
            said = "servers that share an object store must share a database: give --database postgresql+psycopg://..."
            raise SettingsError(said, where="database", code="objects-database")
        if self.shared_roots.roots and self.executor == "ray":
            said = "shared roots are read by workers on the server's own machine: --executor local"
            raise SettingsError(said, where="shared_roots", code="shared-root")
        for label in self.ray_labels:
            if not LABEL.fullmatch(label):
                raise SettingsError(f"{label!r} is not a node label: write NAME=VALUE", where="ray_labels", code="ray-label")
        for origin in self.allowed_origins:
            if not ORIGIN.fullmatch(origin):
                said = f"{origin!r} is not an origin: write SCHEME://HOST or SCHEME://HOST:PORT, without a path or *"
                raise SettingsError(said, where="allowed_origins", code="allow-origin")

    @property
    def on_loopback(self) -> bool:
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def needs_keys(self) -> bool:
        return not self.on_loopback if self.require_keys is None else self.require_keys

    @property
    def database_url(self) -> str:
        return self.database or f"sqlite:///{(self.data / 'primray.sqlite').resolve()}"

    @property
    def usable_cores(self) -> int:
        return self.cores or len(os.sched_getaffinity(0))
