"""The caller's identity and remaining quotas, and this server's capabilities."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from primray import __version__
from primray.aovs import AOVS, CRYPTOMATTES

from ..api import views
from ..http.answers import json_answer
from ..http.callers import COOKIE, Reader, Serving
from ..http.described import answer
from ..http.routing import Router
from ..jobs import Json
from ..limits import Quotas
from ..pictures.request import MEDIA_TYPES as PREVIEW_TYPES
from ..pictures.request import VIEWS
from ..scenes.recognize import MEDIA_TYPES as SCENE_TYPES
from ..store.base import Usage
from .keys import key_json

router = Router("/v1", resource="account", tag="account")

SUFFIXES = {"usda": [".usda", ".usd"], "usdc": [".usdc", ".usd"], "usdz": [".usdz"], "zip": [".zip"]}


@router.get("/whoami", answer(views.WhoAmI))
def whoami(request: Request, caller: Reader) -> Response:
    """Return the tenant and the key that the request is made with."""
    return json_answer(
        {
            "tenant": caller.tenant,
            "name": "" if caller.key is None else caller.key.name,
            "scopes": sorted(caller.scopes),
            "key": None if caller.key is None else key_json(caller.key),
            "session": COOKIE in request.cookies and "authorization" not in request.headers,
        }
    )


@router.get("/usage", answer(views.Usage))
def usage(caller: Reader, service: Serving) -> Response:
    """Return what the tenant uses now, with its quotas (null: no limit)."""
    used = service.store.usage(caller.tenant, time.time())
    return json_answer(usage_json(caller.tenant, used, service.quotas_of(caller)))


def usage_json(tenant: str, used: Usage, quotas: Quotas) -> Json:
    return {
        "tenant": tenant,
        "queued_jobs": {"used": used.queued_jobs, "limit": quotas.queued_jobs},
        "running_jobs": {"used": used.running_jobs, "limit": quotas.running_jobs},
        "stored_bytes": {"used": used.stored_bytes, "limit": quotas.stored_bytes},
        "cpu_s_per_day": {"used": used.cpu_s_today, "limit": quotas.cpu_s_per_day},
        "cpu_s_total": used.cpu_s_total,
        "requests_per_s": {"limit": quotas.requests_per_s, "burst": quotas.burst},
    }


@router.get("/capabilities", answer(views.Capabilities))
def capabilities(caller: Reader, service: Serving) -> Response:
    """Return the version, accepted inputs, available outputs, and all limits."""
    leading = service.who_leads.now()
    capacity = leading.capacity
    inputs: list[Json] = [
        {"kind": kind, "media_type": media_type, "suffixes": SUFFIXES[kind]} for kind, media_type in SCENE_TYPES.items()
    ]
    found: dict[str, Any] = {
        "version": __version__,
        "api": "v1",
        "inputs": inputs,
        "outputs": [
            {"name": "beauty.exr", "media_type": "image/x-exr"},
            {"name": "beauty.png", "media_type": "image/png"},
            {"name": "report.json", "media_type": "application/json"},
        ],
        "previews": {"views": list(VIEWS), "formats": PREVIEW_TYPES},
        "error_metrics": ["relmse", "rmse", "display"],
        "aovs": [{"name": name, "meaning": kind.meaning} for name, kind in (AOVS | CRYPTOMATTES).items()],
        "limits": asdict(service.limits),
        "quotas": asdict(service.quotas_of(caller)),
        "executor": {
            "slots": capacity.slots,
            "cores": capacity.cores,
            "threads": capacity.threads,
            "memory_bytes": capacity.memory_bytes,
            "nodes": capacity.nodes,
        },
        "sandbox": leading.sandbox,
        "shared_roots": service.data.shared_roots.names(caller.tenant),
    }
    return json_answer(found)
