"""Administration of all tenants over HTTP: `Client(...).admin`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import quote

from .documents import Frame, Job, Json, QuotaChanges, TenantUsage, Workers, read
from .transport import Transport, items_of, json_of, object_of

PAGE_ITEMS = 200


class Administration:
    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def documents(
        self, *, tenant: str | None = None, state: str | None = None, labels: Mapping[str, str] | None = None
    ) -> Iterator[Json]:
        """Yield the jobs of all tenants, or of one, newest first, as the server describes them; pages are requested as needed.
        Labels are searched within one tenant."""
        found = [f"{name}:{value}" for name, value in (labels or {}).items()]
        params: Json = {"limit": PAGE_ITEMS, "tenant": tenant, "state": state, "label": found or None}
        while True:
            page = object_of(self._get("/v1/admin/jobs", params))
            yield from (object_of(item) for item in items_of(page))
            if page.get("next_cursor") is None:
                return
            params["cursor"] = page["next_cursor"]

    def jobs(
        self, *, tenant: str | None = None, state: str | None = None, labels: Mapping[str, str] | None = None
    ) -> Iterator[Job]:
        return (read(Job, document) for document in self.documents(tenant=tenant, state=state, labels=labels))

    def job(self, job_id: str) -> Job:
        return read(Job, self._get(_job(job_id)))

    def frames(self, job_id: str) -> Iterator[Frame]:
        return (read(Frame, item) for item in self._following(f"{_job(job_id)}/frames"))

    def change(self, job_id: str, *, priority: int) -> Job:
        answer = self._transport.request("PATCH", _job(job_id), body={"priority": priority}, repeatable=True)
        return read(Job, json_of(answer))

    def cancel(self, job_id: str) -> Job:
        return self._do(job_id, "cancel")

    def pause(self, job_id: str) -> Job:
        return self._do(job_id, "pause")

    def resume(self, job_id: str) -> Job:
        return self._do(job_id, "resume")

    def retry_frame(self, job_id: str, number: int) -> Job:
        return read(Job, json_of(self._transport.request("POST", f"{_job(job_id)}/frames/{number}/retry")))

    def workers(self) -> Workers:
        """Return the nodes where renders run, and the frames that run now."""
        return read(Workers, self.workers_document())

    def workers_document(self) -> Json:
        """Return the workers as the server describes them."""
        return object_of(self._get("/v1/admin/workers"))

    def tenants(self) -> Iterator[TenantUsage]:
        """Yield each tenant's usage and quotas, by name."""
        return (read(TenantUsage, item) for item in self._following("/v1/admin/tenants"))

    def tenant(self, name: str) -> TenantUsage:
        return read(TenantUsage, self._get(_tenant(name)))

    def set_quotas(self, tenant: str, quotas: QuotaChanges) -> TenantUsage:
        """Change quotas of a tenant. Omitted members stay as they are; None is no limit."""
        answer = self._transport.request("PATCH", f"{_tenant(tenant)}/quotas", body=dict(quotas), repeatable=True)
        return read(TenantUsage, json_of(answer))

    def unset_quotas(self, tenant: str) -> TenantUsage:
        """Remove a tenant's own quotas, so that those of its keys apply again."""
        return read(TenantUsage, json_of(self._transport.request("DELETE", f"{_tenant(tenant)}/quotas")))

    def _do(self, job_id: str, what: str) -> Job:
        return read(Job, json_of(self._transport.request("POST", f"{_job(job_id)}/{what}", repeatable=True)))

    def _get(self, path: str, params: Json | None = None) -> Any:
        asked = {name: value for name, value in (params or {}).items() if value is not None}
        return json_of(self._transport.request("GET", path, params=asked, headers={"Accept": "application/json"}))

    def _following(self, path: str) -> Iterator[Any]:
        """Yield the items of all pages of a list that continues after the last item of each."""
        params: Json = {"limit": PAGE_ITEMS}
        while True:
            page = object_of(self._get(path, params))
            yield from items_of(page)
            if page.get("next_after") is None:
                return
            params["after"] = page["next_after"]


def _job(job_id: str) -> str:
    return f"/v1/admin/jobs/{quote(job_id, safe='')}"


def _tenant(name: str) -> str:
    return f"/v1/admin/tenants/{quote(name, safe='')}"
