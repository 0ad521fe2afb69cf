"""Answers to administrators, as models (see views.py)."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from ..jobs import JobState
from .account_views import KeyQuotas, Usage
from .views import Frame, Job, View


class AdminJob(Job):
    tenant: str = Field(description="The job's tenant.")


class AdminJobPage(View):
    items: list[AdminJob]
    next_cursor: str | None


class AdminFramePage(View):
    items: list[Frame]
    next_after: int | None = Field(description="Value of ?after= for the next page.")


class Tenant(Usage):
    quotas: KeyQuotas = Field(description="Effective quotas.")
    quotas_set: dict[str, Any] = Field(description="Quotas that an administrator has set.")


class TenantPage(View):
    items: list[Tenant]
    next_after: str | None = Field(description="Value of ?after= for the next page.")


class WorkerNode(View):
    id: str
    slots: int = Field(description="Number of concurrent renders.")
    why: str = Field(description="Why the node takes no work; empty if it does.")


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
    parts: int | Literal["auto"] | None = Field(description="Most slots in which it is rendered; null: one.")
    started_at: datetime | None
    cpu_s: float


class Workers(View):
    dispatcher: Literal["here", "elsewhere", "nowhere"] = Field(
        description="The server that dispatches: this one, another, or none."
    )
    slots: int
    cores: int
    memory_bytes: int = Field(description="Memory limit of one render.")
    nodes: list[WorkerNode]
    running: list[RunningFrame]
