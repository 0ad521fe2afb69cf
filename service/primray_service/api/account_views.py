"""Answers about keys, usage and the server's capabilities, as models (see views.py)."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from .views import View

Scope = Literal["submit", "read", "admin"]


class KeyQuotas(View):
    """Quotas of a key; null: no limit."""

    requests_per_s: float | None
    burst: int
    queued_jobs: int | None
    running_jobs: int | None
    stored_bytes: int | None
    cpu_s_per_day: float | None


class Key(View):
    id: str
    object: Literal["key"]
    tenant: str
    name: str
    prefix: str = Field(description="First characters of the key, to recognise it by.")
    scopes: list[Scope]
    quotas: KeyQuotas
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None


class NewKey(Key):
    key: str = Field(description="The key itself, which only this answer contains.")


class KeyList(View):
    items: list[Key]


class WhoAmI(View):
    tenant: str
    name: str
    scopes: list[Scope]
    key: Key | None
    session: bool = Field(description="Whether the caller used a session cookie instead of a key.")


class Count(View):
    used: int
    limit: int | None


class Seconds(View):
    used: float
    limit: float | None


class Rate(View):
    limit: float | None
    burst: int


class Usage(View):
    tenant: str
    queued_jobs: Count
    running_jobs: Count
    stored_bytes: Count
    cpu_s_per_day: Seconds
    cpu_s_total: float
    requests_per_s: Rate


class InputKind(View):
    kind: str
    media_type: str
    suffixes: list[str]


class OutputKind(View):
    name: str
    media_type: str


class Previews(View):
    views: list[str]
    formats: dict[str, str]


class AovName(View):
    name: str = Field(description="Name for settings.aovs.")
    meaning: str


class ExecutorOfServer(View):
    slots: int
    cores: int
    threads: int
    memory_bytes: int
    nodes: int


class Capabilities(View):
    version: str
    api: str
    inputs: list[InputKind]
    outputs: list[OutputKind]
    previews: Previews
    error_metrics: list[str]
    aovs: list[AovName] = Field(description="AOVs of any scene; primvar:NAME and labels:TAXONOMY depend on the scene.")
    limits: dict[str, Any]
    quotas: KeyQuotas
    executor: ExecutorOfServer
    sandbox: dict[str, Any]
    shared_roots: list[str] = Field(description="Names of shared storage whose stages this tenant's jobs may name.")
