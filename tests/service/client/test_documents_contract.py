"""The client against schemas/openapi.json: every operation that it asks for, everything it sends and every member it reads
is there."""

from __future__ import annotations

import dataclasses
import inspect
import json
import re
import types
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints
from urllib.parse import parse_qs, urlsplit

import pytest

from primray_service.client import (
    Administration,
    Client,
    Convergence,
    Event,
    Frame,
    Job,
    Key,
    Output,
    Progress,
    RunningFrame,
    Scene,
    TenantUsage,
    Usage,
    WorkerNode,
    Workers,
    documents,
)

from .scripted import Answer, Request, Scripted, as_json, serving

DOCUMENT = json.loads((Path(__file__).parents[3] / "schemas/openapi.json").read_text())
COMPONENTS = DOCUMENT["components"]["schemas"]

READ: dict[type, str] = {
    Scene: "Scene",
    Job: "AdminJob",
    documents.SceneOfJob: "SceneReference",
    Progress: "Progress",
    documents.QueuePlace: "QueuePlace",
    documents.FrameCounts: "FrameCounts",
    documents.ErrorOfNow: "ErrorOfNow",
    Frame: "Frame",
    Output: "Output",
    Convergence: "ConvergenceRow",
    Event: "Event",
    Usage: "Usage",
    Key: "NewKey",
    TenantUsage: "Tenant",
    WorkerNode: "WorkerNode",
    RunningFrame: "RunningFrame",
    Workers: "Workers",
}
JSON_TYPES: dict[Any, set[str]] = {
    str: {"string"},
    int: {"integer"},
    float: {"number", "integer"},
    bool: {"boolean"},
    datetime: {"string"},
    list: {"array"},
    tuple: {"array"},
    dict: {"object"},
}


def alternatives(schema: dict[str, Any]) -> list[dict[str, Any]]:
    """A schema's alternatives, with references followed."""
    if "$ref" in schema:
        return alternatives(COMPONENTS[schema["$ref"].rpartition("/")[2]])
    if "anyOf" in schema:
        return [found for each in schema["anyOf"] for found in alternatives(each)]
    return [schema]


def takes(hint: Any, schema: dict[str, Any]) -> bool:
    """Whether every JSON value of the schema's types can be read as `hint`."""
    hints = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    for each in alternatives(schema):
        kind = each.get("type")
        if kind == "null":
            if type(None) not in hints:
                return False
        elif not any(
            (dataclasses.is_dataclass(one) and kind == "object") or kind in JSON_TYPES.get(get_origin(one) or one, ())
            for one in hints
        ):
            return False
    return True


@pytest.mark.parametrize("kind", READ, ids=lambda kind: kind.__name__)
def test_what_is_read_exists(kind: type) -> None:
    schema = COMPONENTS[READ[kind]]
    hints = get_type_hints(kind)
    for field in dataclasses.fields(kind):
        if field.metadata.get("rest"):
            assert schema.get("additionalProperties") is not False
            continue
        where = f"{kind.__name__}.{field.name}"
        assert field.name in schema["properties"], f"{where} is not in the document"
        assert takes(hints[field.name], schema["properties"][field.name]), where
        has_default = field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
        assert has_default or field.name in schema["required"], f"{where} may be missing"


def test_every_dataclass_is_held_to_something() -> None:
    made = {each for _, each in inspect.getmembers(documents, dataclasses.is_dataclass)}
    assert made - set(READ) == {documents.Share}
    for name in ("Count", "Seconds"):
        assert set(COMPONENTS[name]["properties"]) == {"used", "limit"}


def test_terminal_states_are_the_services() -> None:
    from primray_service.jobs import TERMINAL

    assert {state.value for state in TERMINAL} == documents.TERMINAL <= set(COMPONENTS["JobState"]["enum"])


@pytest.mark.parametrize("name", ["Settings", "StopRules", "Webhook", "QuotaChanges"])
def test_what_is_sent_is_all_that_can_be(name: str) -> None:
    schema = COMPONENTS["QuotaRequest" if name == "QuotaChanges" else name]
    assert set(getattr(documents, name).__annotations__) == set(schema["properties"])


SCENE_ID = "sha256:" + "0" * 64
JOB = {"id": "job_1", "state": "succeeded", "created_at": "2026-01-01T00:00:00Z", "scene": {"id": SCENE_ID}}
KEY = {"id": "key_1", "tenant": "t", "prefix": "p"}
SHARE = {"used": 0, "limit": None}
OUTPUT = Output("a.exr", 3, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad")
USAGE = dict.fromkeys(("queued_jobs", "running_jobs", "stored_bytes", "cpu_s_per_day"), SHARE) | {
    "tenant": "t",
    "cpu_s_total": 0.0,
}
ANSWERS: list[tuple[str, Any]] = [
    (r"GET /v1/admin/(jobs|tenants)(\?.*)?|GET /v1/admin/jobs/.*/frames(\?.*)?", {"items": []}),
    (r"GET /v1/admin/workers", {"dispatcher": "here", "slots": 1}),
    (r".* /v1/admin/tenants/.*", USAGE),
    (r"GET .*/events", None),
    (r"GET .*/outputs/.*", b"abc"),
    (r"GET .*/(preview|log)", b"abc"),
    (r"GET .*/convergence.*", []),
    (r"GET .*/frames/\d+", {"number": 0, "state": "queued"}),
    (r"GET /v1/(scenes|jobs|keys)(\?.*)?|GET .*/(outputs|frames)", {"items": []}),
    (r"POST /v1/keys", KEY),
    (r"GET /v1/usage", USAGE),
    (r"POST /v1/packages", {"id": SCENE_ID, "state": "ready"}),
    (r".* /v1/scenes.*", {"id": SCENE_ID, "state": "ready"}),
    (r".*", JOB),
]


def script(request: Request) -> Answer:
    if request.method == "HEAD" and request.path == f"/v1/scenes/sha256:{ABSENT}":
        return Answer(404)
    if request.path.endswith("/events"):
        is_page = request.headers["Accept"] == "application/json"
        return as_json({"items": [], "next_after": 0, "ended": True}) if is_page else Answer(204)
    body = next(answer for pattern, answer in ANSWERS if re.fullmatch(pattern, f"{request.method} {request.path}"))
    return Answer(200, body) if isinstance(body, bytes) else as_json(body)


ABSENT = "3a6eb0790f39ac87c94f3856b2dd2c5d110e6811602261a9a923d3bb23adc8b7"  # of "data"


def ask_for_everything(server: Scripted, folder: Path) -> set[str]:
    """Call every method once, with all that it takes; their names."""
    (folder / "shot.usda").write_bytes(b"data")
    full: documents.Settings = {"camera": "/cam", "frames": "1", "stop": {"target_error": 0.1}}
    with Client(server.url, "key", retries=0) as client:
        calls: dict[str, Callable[[], object]] = {
            "upload": lambda: client.upload(folder / "shot.usda"),
            "upload_files": lambda: client.upload_files({"shot.usda": folder / "shot.usda"}, name="shot.zip"),
            "find_scene": lambda: client.find_scene(SCENE_ID),
            "scene": lambda: client.scene(SCENE_ID),
            "wait_for_scene": lambda: client.wait_for_scene(SCENE_ID),
            "scenes": lambda: list(client.scenes()),
            "delete_scene": lambda: client.delete_scene(SCENE_ID),
            "submit": lambda: client.submit(
                SCENE_ID, entry="a", settings=full, priority=1, labels={"a": "b"}, ttl_s=9.0, webhook={"url": "https://x"}
            ),
            "job": lambda: client.job("job_1"),
            "document": lambda: client.document("job_1"),
            "documents": lambda: list(client.documents(state="queued", labels={"a": "b"})),
            "jobs": lambda: list(client.jobs(state="queued", labels={"a": "b"})),
            "wait": lambda: client.wait("job_1"),
            "last_event_id": lambda: client.last_event_id("job_1"),
            "watch": lambda: list(client.watch("job_1", after=3)),
            "change": lambda: client.change("job_1", priority=1, labels={"a": "b"}, ttl_s=9.0),
            "cancel": lambda: client.cancel("job_1"),
            "pause": lambda: client.pause("job_1"),
            "resume": lambda: client.resume("job_1"),
            "retry_frame": lambda: client.retry_frame("job_1", 3),
            "continue_": lambda: client.continue_("job_1", {"max_samples": 5}),
            "delete": lambda: client.delete("job_1"),
            "frames": lambda: list(client.frames("job_1")),
            "frame": lambda: client.frame("job_1", 0),
            "explain": lambda: client.explain("job_1", 3, 4, frame=1),
            "convergence": lambda: client.convergence("job_1", 0),
            "preview": lambda: client.preview("job_1", frame=0, exposure=1.0, view="beauty"),
            "log": lambda: client.log("job_1"),
            "outputs": lambda: client.outputs("job_1"),
            "download": lambda: client.download("job_1", OUTPUT, folder),
            "whoami": lambda: client.whoami(),
            "usage": lambda: client.usage(),
            "capabilities": lambda: client.capabilities(),
            "create_key": lambda: client.create_key("t", name="n", scopes=["read"], expires_in_s=9.0),
            "list_keys": lambda: list(client.list_keys()),
            "revoke_key": lambda: client.revoke_key("key_1"),
        }
        admin = client.admin
        of_admin: dict[str, Callable[[], object]] = {
            "documents": lambda: list(admin.documents(tenant="t", state="queued", labels={"a": "b"})),
            "jobs": lambda: list(admin.jobs(tenant="t", state="queued")),
            "job": lambda: admin.job("job_1"),
            "frames": lambda: list(admin.frames("job_1")),
            "change": lambda: admin.change("job_1", priority=3),
            "cancel": lambda: admin.cancel("job_1"),
            "pause": lambda: admin.pause("job_1"),
            "resume": lambda: admin.resume("job_1"),
            "retry_frame": lambda: admin.retry_frame("job_1", 3),
            "workers": lambda: admin.workers(),
            "workers_document": lambda: admin.workers_document(),
            "tenants": lambda: list(admin.tenants()),
            "tenant": lambda: admin.tenant("t"),
            "set_quotas": lambda: admin.set_quotas("t", {"running_jobs": None}),
            "unset_quotas": lambda: admin.unset_quotas("t"),
        }
        for call in (*calls.values(), *of_admin.values()):
            call()
    return set(calls) | {f"admin.{name}" for name in of_admin}


def operation_of(method: str, path: str) -> dict[str, Any]:
    for template, operations in DOCUMENT["paths"].items():
        if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", template), path) and method.lower() in operations:
            found: dict[str, Any] = operations[method.lower()]
            return found
    raise AssertionError(f"{method} {path} is not in the document")


def test_every_request_is_one_of_the_documents(tmp_path: Path) -> None:
    with serving(script) as server:
        called = ask_for_everything(server, tmp_path)
    public = {name for name, _ in inspect.getmembers(Client, inspect.isfunction) if not name.startswith("_")}
    public |= {f"admin.{name}" for name, _ in inspect.getmembers(Administration, inspect.isfunction) if name[0] != "_"}
    assert called == public - {"close"}
    for request in server.requests:
        where = f"{request.method} {request.path}"
        split = urlsplit(request.path)
        operation = operation_of(request.method, split.path)
        known = {parameter["name"] for parameter in operation.get("parameters", []) if parameter["in"] == "query"}
        assert set(parse_qs(split.query, keep_blank_values=True)) <= known, where
        if request.headers.get("Content-Type") == "application/json":
            schema = operation["requestBody"]["content"]["application/json"]["schema"]
            check_body(json.loads(request.body), schema, where)
    for name in ("Idempotency-Key",):
        assert any(name == parameter["name"] for parameter in operation_of("POST", "/v1/jobs")["parameters"])


def check_body(body: Any, schema: dict[str, Any], where: str) -> None:
    """Every member is one that the document knows."""
    for each in alternatives(schema):
        if isinstance(body, dict) and each.get("type") == "object" and "properties" in each:
            assert set(body) <= set(each["properties"]), where
            for name, value in body.items():
                check_body(value, each["properties"][name], f"{where} {name}")
