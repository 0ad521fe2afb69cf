"""A line in the server's log for each action of an administrator: who did what, to whom."""

from __future__ import annotations

import structlog

from ...access.auth import Caller

log = structlog.get_logger()


def record(caller: Caller, action: str, tenant: str, **about: object) -> None:
    """`tenant` is the one that the action concerns; who acted is `by`, the id of a key, or "local" where none is needed."""
    key = caller.key
    by = {"by": "local", "by_name": "", "by_tenant": caller.tenant}
    if key is not None:
        by = {"by": key.id, "by_name": key.name, "by_tenant": key.tenant}
    log.info("audit", action=action, of_tenant=tenant, **by, **about)
