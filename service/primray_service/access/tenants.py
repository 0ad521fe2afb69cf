"""Effective quotas of a tenant: those of its newest valid key, or this server's; settings by an administrator take
precedence."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from ..limits import Quotas
from .auth import Caller

if TYPE_CHECKING:
    from ..jobs import Json
    from ..store.base import Store

REMEMBERED_S = 5.0  # upper bound of the time until another server's change takes effect
REMEMBERED = 10_000
NAMES = frozenset(field.name for field in fields(Quotas))


class TenantQuotas:
    """Quotas by tenant, cached for a few seconds. Thread-safe."""

    def __init__(self, store: Store, default: Quotas) -> None:
        self._store = store
        self._default = default
        self._set: dict[str, tuple[float, Json]] = {}
        self._of_keys: dict[str, tuple[float, Quotas]] = {}

    def of(self, tenant: str) -> Quotas:
        """Return the quotas that the queue applies to a tenant, whichever of its keys a job came with. May block on the
        store."""
        found = _remembered(self._of_keys, tenant, lambda: self._newest_keys(tenant))
        return self._changed(found, tenant)

    def of_caller(self, caller: Caller) -> Quotas:
        """Return the quotas of the key that a request came with. May block on the store: see `is_known`."""
        return self._changed(caller.quotas(self._default), caller.tenant)

    def is_known(self, tenant: str) -> bool:
        """Return whether `of_caller` answers without reading the store."""
        known = self._set.get(tenant)
        return known is not None and time.monotonic() - known[0] < REMEMBERED_S

    def forget(self, tenant: str) -> None:
        """Drop a tenant's cached quotas, so that a change made here takes effect at once."""
        self._set.pop(tenant, None)

    def _changed(self, quotas: Quotas, tenant: str) -> Quotas:
        changes = _remembered(self._set, tenant, lambda: self._store.quotas_set(tenant))
        return replace(quotas, **{name: value for name, value in changes.items() if name in NAMES}) if changes else quotas

    def _newest_keys(self, tenant: str) -> Quotas:
        now = time.time()
        valid = [
            key
            for key in self._store.keys(tenant)
            if key.revoked_at is None and (key.expires_at is None or key.expires_at > now)
        ]
        return max(valid, key=lambda key: key.created_at).quotas if valid else self._default


def _remembered(known: dict[str, tuple[float, Any]], tenant: str, read: Callable[[], Any]) -> Any:
    seen = known.get(tenant)
    if seen is not None and time.monotonic() - seen[0] < REMEMBERED_S:
        return seen[1]
    found = read()
    if len(known) >= REMEMBERED:
        known.clear()
    known[tenant] = (time.monotonic(), found)
    return found
