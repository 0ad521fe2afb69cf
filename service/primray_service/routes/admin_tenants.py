"""Tenants for an administrator: their usage and quotas, which can be set here."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import Annotated

from pydantic import Field
from starlette.responses import Response

from ..api import views
from ..auth import TENANT_NAME
from ..http.answers import json_answer
from ..http.bodies import json_body
from ..http.callers import Admin, Serving, audit
from ..http.described import answer
from ..http.routing import Router
from ..jobs import Json
from ..service import Service
from ..store.base import Usage
from .account import usage_json
from .keys import QuotaRequest

router = Router("/v1/admin/tenants", resource="admin_tenants", tag="admin")

TenantName = Annotated[str, Field(pattern=f"^{TENANT_NAME.pattern}$", description="A tenant's name.")]


def tenant_json(service: Service, tenant: str, used: Usage) -> Json:
    quotas = service.tenant_quotas.of(tenant)
    set_here = service.store.quotas_set(tenant)
    return {**usage_json(tenant, used, quotas), "quotas": asdict(quotas), "quotas_set": set_here}


@router.get("", answer(views.TenantPage), problems=("invalid-request",))
def list_tenants(
    caller: Admin,
    service: Serving,
    limit: Annotated[int, Field(ge=1, le=200)] = 50,
    after: Annotated[str, Field(max_length=64, description="Only names after this one.")] = "",
) -> Response:
    """List all tenants that have a key, or have used anything, with their usage and quotas."""
    rows = service.store.usage_of_all(time.time(), limit + 1, after)
    next_after = rows[limit - 1][0] if len(rows) > limit else None
    items = [tenant_json(service, tenant, used) for tenant, used in rows[:limit]]
    return json_answer({"items": items, "next_after": next_after})


@router.get("/{tenant}", answer(views.Tenant), problems=("invalid-request",))
def show(tenant: TenantName, caller: Admin, service: Serving) -> Response:
    """Return a tenant's usage and quotas; a tenant is created by naming it, so none is not found."""
    return json_answer(tenant_json(service, tenant, service.store.usage(tenant, time.time())))


@router.patch("/{tenant}/quotas", answer(views.Tenant, description="The tenant's quotas from now on."))
def set_quotas(
    tenant: TenantName,
    caller: Admin,
    service: Serving,
    asked: Annotated[QuotaRequest, json_body(QuotaRequest, {"running_jobs": 4, "cpu_s_per_day": None})],
) -> Response:
    """Set quotas of a tenant, overriding those of its keys. Members that are omitted stay as they are; null: no limit.

    Running jobs continue. Other servers on the same database apply the quotas within seconds.
    """
    quotas = service.store.quotas_set(tenant) | asked.model_dump(exclude_unset=True)
    service.store.set_quotas(tenant, quotas, time.time())
    service.tenant_quotas.forget(tenant)
    audit(caller, "set-quotas", tenant, quotas=quotas)
    service.dispatcher.wake()
    return show(tenant, caller, service)


@router.delete("/{tenant}/quotas", answer(views.Tenant), problems=("invalid-request",))
def unset_quotas(tenant: TenantName, caller: Admin, service: Serving) -> Response:
    """Remove the quotas set by an administrator: those of the tenant's newest key apply again, or the server's."""
    service.store.set_quotas(tenant, {}, time.time())
    service.tenant_quotas.forget(tenant)
    audit(caller, "unset-quotas", tenant)
    service.dispatcher.wake()
    return show(tenant, caller, service)
