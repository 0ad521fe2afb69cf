"""Audit log: a line in the server's log for each action of an administrator."""

from __future__ import annotations

import structlog

from ...auth import Caller

log = structlog.get_logger()


def record(caller: Caller, action: str, tenant: str, **about: object) -> None:
    """Log an action. `tenant` is the one concerned; `by` is the id of the administrator's key, or "local" if none is needed."""
    key = caller.key
    by = {"by": "local", "by_name": "", "by_tenant": caller.tenant}
    if key is not None:
        by = {"by": key.id, "by_name": key.name, "by_tenant": key.tenant}
    log.info("audit", action=action, of_tenant=tenant, **by, **about)
