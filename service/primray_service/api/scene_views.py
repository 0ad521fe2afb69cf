"""Answers about scenes and files, as models (see views.py)."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from ..jobs import SceneState
from .views import Problem, View, Warning


class SceneUrls(View):
    self: str


class Scene(View):
    """A scene. Once the state is ready, further members have the results of the check."""

    id: str = Field(
        pattern="^sha256:[0-9a-f]{64}$", description="Digest of the bytes as sent, or of the package's list of files."
    )
    object: Literal["scene"]
    state: SceneState
    kind: Literal["usda", "usdc", "usdz", "zip", "shared"]
    name: str
    bytes: int
    stored_bytes: int
    created_at: datetime
    warnings: list[Warning]
    problem: Problem | None = Field(description="Why it was rejected.")
    urls: SceneUrls


class Package(View):
    """Files of a package that have to be sent."""

    id: str = Field(pattern="^sha256:[0-9a-f]{64}$", description="The scene's future id.")
    missing: list[str] = Field(description="SHA-256s of files that this tenant has not sent.")
    missing_bytes: int


class ScenePage(View):
    items: list[Scene]
    next_cursor: str | None


class OutputUrls(View):
    self: str
    immutable: str = Field(description="Address of exactly this version, which may be cached for ever.")


class Output(View):
    name: str
    frame: int | None
    bytes: int
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    media_type: str
    created_at: datetime
    urls: OutputUrls


class OutputList(View):
    items: list[Output]


class Health(View):
    status: Literal["ok"]


class Readiness(View):
    status: Literal["ready", "not ready", "stopping"]
    checks: dict[str, dict[str, Any]] = Field(
        description="Results for database, disk, executor and sandbox: ok, detail, seconds."
    )
