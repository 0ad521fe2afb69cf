"""Whose turn it is among tenants that the queue's order (priority, fewest frames running, oldest job) would serve one after the
other: where several wait with equal rights, the one that was served the longest time ago."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from ..limits import Quotas

QuotasOf = Callable[[str], Quotas]


def quotas_of_next_claim(
    real: QuotasOf, waiting: Sequence[tuple[int, str]], running: Mapping[str, int], served: Mapping[str, float]
) -> QuotasOf:
    """Quotas with which the next claim is that tenant's. `waiting`: (priority, tenant); `served`: when each was last."""
    highest = max(priority for priority, _ in waiting)
    equal = [tenant for priority, tenant in waiting if priority == highest]
    fewest = min(running.get(tenant, 0) for tenant in equal)
    equal = [tenant for tenant in equal if running.get(tenant, 0) == fewest]
    if len(equal) == 1:
        return real
    first = min(equal, key=lambda tenant: (served.get(tenant, 0.0), tenant))
    if served.get(first, 0.0) == 0.0:  # among tenants that were never served, the queue's own order
        passed_over = {tenant for tenant in equal if served.get(tenant, 0.0) > 0.0}
    else:
        passed_over = set(equal) - {first}
    return lambda tenant: replace(real(tenant), running_jobs=0) if tenant in passed_over else real(tenant)
