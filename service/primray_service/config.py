"""What `primray serve` was asked to do; checked when made."""

from __future__ import annotations

import ipaddress
import os
import re
from dataclasses import dataclass, field
from pathlib import Path

from primray.errors import SettingsError

from .executor import by_name
from .limits import Limits, Quotas
from .shared_roots import SharedRoots

# As Ray writes labels: a name, maybe with a domain before it, and a value.
LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._/-]*=[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class ServeConfig:
    """`host` and `port`: where to listen (port 0: any that is free)."""

    data: Path
    # What servers share, where that is an object store and not the folder `data`: any URL that fsspec opens.
    objects: str | None = None
    host: str = "127.0.0.1"
    port: int = 8700
    # An SQLAlchemy URL (sqlite:///... or postgresql+psycopg://...); None: SQLite in the data directory.
    database: str | None = None
    limits: Limits = field(default_factory=Limits)
    quotas: Quotas = field(default_factory=Quotas)  # of tenants whose keys name none
    shared_roots: SharedRoots = field(default_factory=SharedRoots)  # of shared storage, that jobs may name
    slots: int | None = None  # renders at a time; None: one for eight cores
    executor: str = by_name.DEFAULT  # where renders run: a name of executor/by_name.py
    cores: int | None = None  # None: all that this process may use
    # Of the executor "ray": the cluster (HOST:PORT, or auto: that this machine is a node of), cores of a node that one render
    # takes (None: 8, or all of the smallest node's), and labels, NAME=VALUE, that nodes must have.
    ray_address: str = "auto"
    ray_cores: int | None = None
    ray_labels: tuple[str, ...] = ()
    require_keys: bool | None = None  # None: unless on loopback
    allow_unsandboxed: bool = False
    allowed_hosts: tuple[str, ...] = ()  # names, beside its own address, that the server answers for
    dispatch: bool = True  # whether this server takes part in holding the lease
    metrics_key: bool = True  # /metrics needs an admin key where keys are needed
    webhook_networks: tuple[str, ...] = ()  # private networks that webhooks may call, for tests and closed networks
    webhook_http: bool = False  # plain http is allowed
    warm: bool = True  # keep workers ready before there is work
    log_json: bool = True

    def __post_init__(self) -> None:
        """SettingsError for an executor that there is not, and for labels that are none."""
        by_name.check_name(self.executor)
        if self.objects is not None and self.database is None:
            said = "servers that share an object store share a database: name it, postgresql+psycopg://..."
            raise SettingsError(said, where="database", code="objects-database")
        if self.shared_roots.roots and self.executor == "ray":
            said = "shared roots are read by workers on the server's own machine: --executor local"
            raise SettingsError(said, where="shared_roots", code="shared-root")
        for label in self.ray_labels:
            if not LABEL.fullmatch(label):
                raise SettingsError(f"{label!r} is no label of nodes: NAME=VALUE", where="ray_labels", code="ray-label")

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
