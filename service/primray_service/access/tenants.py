"""What a tenant may use: the quotas of its newest valid key, or this server's."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..limits import Quotas

if TYPE_CHECKING:
    from ..store.base import Store

REMEMBERED_S = 5.0


def quotas_of(store: Store, default: Quotas) -> Callable[[str], Quotas]:
    """From any thread; what was found is good for a few seconds."""
    known: dict[str, tuple[float, Quotas]] = {}

    def of(tenant: str) -> Quotas:
        remembered = known.get(tenant)
        if remembered is not None and time.monotonic() - remembered[0] < REMEMBERED_S:
            return remembered[1]
        now = time.time()
        valid = [
            key for key in store.keys(tenant) if key.revoked_at is None and (key.expires_at is None or key.expires_at > now)
        ]
        found = max(valid, key=lambda key: key.created_at).quotas if valid else default
        known[tenant] = (time.monotonic(), found)
        return found

    return of
