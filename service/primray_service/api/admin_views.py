"""What administrators get, as models; views.py says how these are used."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from ..jobs import JobState
from .account_views import KeyQuotas, Usage
from .views import Frame, Job, View


class AdminJob(Job):
    tenant: str = Field(description="Whose job it is.")


class AdminJobPage(View):
    items: list[AdminJob]
    next_cursor: str | None


class AdminFramePage(View):
    items: list[Frame]
    next_after: int | None = Field(description="For ?after= of the page that comes next.")


class Tenant(Usage):
    quotas: KeyQuotas = Field(description="That hold now.")
    quotas_set: dict[str, Any] = Field(description="Those of them that were set by an administrator.")


class TenantPage(View):
    items: list[Tenant]
    next_after: str | None = Field(description="For ?after= of the page that comes next.")


class WorkerNode(View):
    id: str
    slots: int = Field(description="Renders that it has room for at a time.")
    why: str = Field(description="Why it takes no work; empty: it does.")


class RunningFrame(View):
    job: str
    name: str | None
    tenant: str
    priority: int
    state: JobState
    frame: int
    time_code: float | None
    phase: str
    fraction: float
    parts: int | Literal["auto"] | None = Field(description="The most places that it is rendered in; null: one.")
    started_at: datetime | None
    cpu_s: float


class Workers(View):
    dispatcher: Literal["here", "elsewhere", "nowhere"] = Field(description="Where the server that dispatches is.")
    slots: int
    cores: int
    memory_bytes: int = Field(description="Of one render.")
    nodes: list[WorkerNode]
    running: list[RunningFrame]
