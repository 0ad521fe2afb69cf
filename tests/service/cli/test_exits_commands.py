"""The commands against a server that answers by a script: what is printed where, and how they end when something is wrong."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.service.client.scripted import Answer, Request, as_json, problem, serving

from primray.cli import run
from primray.errors import SettingsError
from primray_service.cli import COMMANDS
from primray_service.cli.exits import CommandError, error_of, error_of_end
from primray_service.cli.submit import parallel_of
from primray_service.client import Job
from primray_service.client.documents import read
from primray_service.client.transport import Transport
from primray_service.problems import KINDS

SCENE = {"id": "sha256:" + "0" * 64, "state": "ready"}
JOB: dict[str, Any] = {
    "id": "job_1",
    "state": "queued",
    "created_at": "2026-01-01T00:00:00.000Z",
    "scene": {"id": SCENE["id"]},
    "settings": {"stop": {"target_error": 0.01}},
    "labels": {"shot": "010\x1b[2J"},
    "progress": {"fraction": 0.5, "error": {"metric": "relmse", "estimate": 0.021, "ci95": [0.019, 0.023], "target": 0.01}},
}
DONE = {**JOB, "state": "succeeded"}


@pytest.fixture(autouse=True)
def _no_server_of_the_user(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("PRIMRAY_SERVER", "PRIMRAY_API_KEY", "PRIMRAY_API_KEY_FILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)


def test_they_are_commands_of_primray(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    listed = capsys.readouterr().out
    for name, (_, help) in COMMANDS.items():
        assert f"{name} " in listed
        assert help in listed
        assert run([name, "--help"]) == 0
        assert f"primray {name} " in capsys.readouterr().out
    assert run(["submt"]) == 2
    assert "submit" in capsys.readouterr().err


def test_nothing_of_the_service_is_imported_before_a_command_runs() -> None:
    heavy = ["httpx2", "starlette", "sqlalchemy", "uvicorn", "structlog", "pxr", "numpy", "rich.progress"]
    code = f"""
import sys, primray.cli as cli
for arguments in (['--help'], ['--version'], ['serve', '--help'], ['submit', '--help'], ['doctor', '--help']):
    assert cli.run(arguments) == 0
    print('LOADED', arguments, [name for name in {heavy} if name in sys.modules])
print('LOADED', [name for name in sys.modules if name.startswith('primray_service.c')])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = [line for line in done.stdout.splitlines() if line.startswith("LOADED")]
    assert len(loaded) == 6
    assert all(line.endswith("[]") for line in loaded[:5]), loaded
    assert "primray_service.client" not in loaded[5]


def test_a_missing_extra_is_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from primray_service.cli import connection

    monkeypatch.setattr(connection, "find_spec", lambda name: None if name == "uvicorn" else object())
    for arguments in (["serve"], ["status"]):
        assert run(arguments) == 1
        assert "pip install 'primray[server]' [uvicorn]" in capsys.readouterr().err


def test_no_server(capsys: pytest.CaptureFixture[str]) -> None:
    with serving([]) as server:
        pass
    assert run(["status", "--server", server.url]) == 1
    said = capsys.readouterr()
    assert f"no answer from {server.url}" in said.err
    assert "primray serve" in said.err
    assert said.out == ""
    assert run(["status", "--server", "nonsense"]) == 2
    assert "not a server's address" in capsys.readouterr().err


def test_keys_come_from_the_environment_or_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "key"
    file.write_text("from_file\n")
    file.chmod(0o600)
    with serving(lambda request: as_json({"items": [], "next_cursor": None})) as server:
        monkeypatch.setenv("PRIMRAY_SERVER", server.url)
        assert run(["status"]) == 0
        monkeypatch.setenv("PRIMRAY_API_KEY_FILE", str(file))
        assert run(["status"]) == 0
        monkeypatch.setenv("PRIMRAY_API_KEY", "from_environment")
        assert run(["status"]) == 0
        assert run(["status", "--key-file", str(file)]) == 0
        assert capsys.readouterr().err == ""
        file.chmod(0o644)
        assert run(["status", "--key-file", str(file)]) == 0
        assert "chmod 600" in capsys.readouterr().err
    sent = [request.headers.get("Authorization") for request in server.requests]
    assert sent == [None, "Bearer from_file", "Bearer from_environment", "Bearer from_file", "Bearer from_file"]
    assert run(["status", "--key-file", str(tmp_path / "none")]) == 2


@pytest.mark.parametrize(("key", "advice"), [(None, "Set PRIMRAY_API_KEY"), ("wrong", "does not accept it")])
def test_a_key_that_is_missing_or_wrong(
    key: str | None, advice: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if key:
        monkeypatch.setenv("PRIMRAY_API_KEY", key)
    with serving([problem("unauthenticated", 401)]) as server:
        assert run(["status", "--server", server.url]) == 1
    said = capsys.readouterr().err
    assert advice in said
    assert "wrong" not in said


def test_every_problem_has_an_exit_code_that_is_documented() -> None:
    for slug in KINDS:
        assert error_of({"type": f"/problems/{slug}", "detail": "d"}).exit_code in (1, 2, 3, 4)
    assert error_of({"type": "/problems/layer-unreadable", "detail": "d"}).exit_code == 3
    assert error_of({"type": "/problems/limit-exceeded", "detail": "d"}).exit_code == 4
    assert error_of({"type": "/problems/invalid-request", "detail": "d"}).exit_code == 2
    assert error_of({"type": "/problems/settings-rejected", "detail": "d"}).exit_code == SettingsError.exit_code == 2
    assert str(error_of({"type": "/problems/layer-unreadable", "detail": "d", "layer": "a.usda", "line": 3})) == (
        "layer-unreadable: d [layer a.usda, line 3]"
    )


@pytest.mark.parametrize(
    ("changes", "exit_code"),
    [
        ({"state": "succeeded", "progress": {"error": {"metric": "relmse", "estimate": 0.009}}}, None),
        ({"state": "succeeded", "settings": {}}, None),
        ({"state": "succeeded"}, 5),
        ({"state": "canceled"}, 1),
        ({"state": "expired"}, 4),
        ({"state": "failed", "error": {"type": "/problems/layer-unreadable", "detail": "d"}}, 3),
        ({"state": "failed", "error": {"type": "/problems/memory-limit", "detail": "d"}}, 4),
        ({"state": "failed", "error": {"type": "/problems/renderer-crashed", "detail": "d"}}, 1),
    ],
)
def test_how_a_job_ended_is_how_the_command_ends(changes: dict[str, Any], exit_code: int | None) -> None:
    error = error_of_end(read(Job, JOB | changes))
    assert (error.exit_code if error else None) == exit_code


def script(request: Request) -> Answer:
    if request.method == "HEAD":
        return problem("not-found", 404)
    if request.path.startswith("/v1/scenes"):
        return as_json({**SCENE, "state": "checking"}, 201)
    if request.path.endswith("/events"):
        events = [
            ("state", {"state": "running"}),
            ("progress", JOB["progress"]),
            ("warning", {"code": "c", "detail": "d\x1b[2J"}),
        ]
        events += [("end", {"state": "succeeded", "attempt": 1})]
        text = "".join(f"id: {n}\nevent: {type}\ndata: {json.dumps(data)}\n\n" for n, (type, data) in enumerate(events, 1))
        return Answer(200, text.encode(), {"Content-Type": "text/event-stream", "Connection": "close"})
    if request.path.endswith("/outputs"):
        return as_json({"items": []})
    if request.path == "/v1/jobs" and request.method == "POST":
        return as_json(JOB, 202)
    return as_json(DONE)


def test_submit_says_what_was_asked_for_and_nothing_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "shot.usda").write_text("#usda 1.0\n")
    flags = "-c /cam --res 640 0 -f 1:10x2 --target-error 0.01 --time-limit 9 --spp 128 --seed 3 --priority 70 -l a=b -l c=d=e"
    more = "--name hero --ttl 2 --no-default-light --default-wrap repeat --purposes default,render --variant /a:s=x --strict"
    more += " --no-translated-shaders"
    more += " --entry e.usda --render-context universal --render-pass /rp"
    flags += " --auto-camera usdrecord --parallel 4"
    with serving(script) as server:
        assert run(["submit", "shot.usda", "--server", server.url, *flags.split(), *more.split()]) == 0
        assert run(["submit", "shot.usda", "--server", server.url]) == 0
    bodies = [json.loads(request.body) for request in server.requests if request.path == "/v1/jobs"]
    assert bodies[0] == {
        "scene": {"id": SCENE["id"], "entry": "e.usda"},
        "settings": {
            "camera": "/cam",
            "auto_camera": "usdrecord",
            "frames": "1:10x2",
            "resolution": [640, 0],
            "stop": {"target_error": 0.01, "max_samples": 128, "max_seconds": 9.0},
            "seed": 3,
            "default_light": False,
            "translated_shaders": False,
            "default_wrap": "repeat",
            "render_context": "universal",
            "render_pass": "/rp",
            "purposes": ["default", "render"],
            "variants": ["/a:s=x"],
            "strict": True,
        },
        "name": "hero",
        "parallel": 4,
        "priority": 70,
        "labels": {"name": "hero", "a": "b", "c": "d=e"},
        "ttl_s": 172_800.0,
    }
    assert bodies[1] == {"scene": {"id": SCENE["id"]}}
    assert "POST /v1/scenes?name=shot.usda" in server.asked  # its messages name the file so
    said = capsys.readouterr()
    assert said.out == "job_1\njob_1\n"
    assert said.err == ""


def test_parallel_is_a_number_or_auto(capsys: pytest.CaptureFixture[str]) -> None:
    assert [parallel_of(text) for text in (None, "auto", "1", "64")] == [None, "auto", 1, 64]
    for text in ("0", "-1", "all", "1.5", "²"):
        with pytest.raises(CommandError, match="a number of at least 1, or auto"):
            parallel_of(text)


def test_submit_and_wait(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "shot.usda").write_text("#usda 1.0\n")
    with serving(script) as server:
        assert run(["submit", "shot.usda", "--server", server.url, "--wait"]) == 5
        said = capsys.readouterr()
        assert said.out == "job_1\n"
        assert "job_1 running" in said.err
        assert "error: target-missed: the error is 0.021, above the target 0.01" in said.err
        assert "warning: c: d?[2J" in said.err
        assert "\x1b" not in said.err
        assert run(["submit", "shot.usda", "--server", server.url, "--wait", "--json"]) == 5
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["type"] for line in lines] == ["job", "event", "event", "event", "event", "job", "error"]
    assert lines[2] == {"type": "event", "job": "job_1", "id": 2, "event": "progress", "data": JOB["progress"]}
    assert lines[-2]["state"] == "succeeded"
    assert lines[-1]["exit_code"] == 5


def test_a_quota_that_frees_up_is_waited_for_and_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    init = Transport.__init__
    monkeypatch.setattr(
        Transport, "__init__", lambda self, *given, **named: init(self, *given, **{**named, "sleep": lambda s: None})
    )
    quota = {"type": "/problems/quota-exceeded", "status": 429, "detail": "2 jobs may wait.", "quota": "queued_jobs"}
    busy = as_json({**quota, "retryable": True}, 429, Retry_After="30")
    with serving([as_json({}), as_json(SCENE), busy, busy, as_json(JOB, 202)]) as server:
        (tmp_path / "shot.usda").write_text("#usda 1.0\n")
        assert run(["submit", "shot.usda", "--server", server.url]) == 0
    said = capsys.readouterr()
    assert said.out == "job_1\n"
    assert said.err.count("waiting: 2 jobs may wait. The request is repeated every 30 s") == 1


def test_a_rejected_scene_is_not_submitted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "shot.usda").write_text("#usda 1.0\n")
    refusal = {"type": "/problems/asset-path-outside-job", "detail": "it refers outside", "asset_path": "/etc/passwd"}
    with serving([as_json({}), as_json({**SCENE, "state": "rejected", "problem": refusal})]) as server:
        assert run(["submit", "shot.usda", "--server", server.url]) == 3
    assert "asset-path-outside-job: it refers outside [asset path /etc/passwd]" in capsys.readouterr().err


def test_status(capsys: pytest.CaptureFixture[str]) -> None:
    with serving(lambda request: as_json({"items": [JOB] * 30}) if "?" in request.path else script(request)) as server:
        assert run(["status", "--server", server.url, "--state", "queued", "-n", "3", "-l", "shot=010"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) == 4
        assert lines[0].split() == ["JOB", "STATE", "DONE", "FRAMES", "ERROR", "TARGET", "ETA", "AGE", "NAME", "LABELS"]
        assert lines[1].split()[:5] == ["job_1", "queued", "50%", "0.021", "0.01"]
        assert "\x1b" not in lines[1]
        assert run(["status", "job_1", "--server", server.url]) == 0
        assert "relmse 0.021 (0.019 to 0.023), target 0.01" in capsys.readouterr().out
        assert run(["status", "job_1", "--json", "--server", server.url]) == 0
        assert json.loads(capsys.readouterr().out) == {"type": "job", **DONE}
    assert server.asked[0] == "GET /v1/jobs?state=queued&label=shot%3A010"


def test_a_list_says_why_a_job_failed(capsys: pytest.CaptureFixture[str]) -> None:
    errors = [{"type": "/problems/settings-rejected", "code": "unknown-camera"}, {"type": "/problems/memory-limit"}]
    jobs = [{**JOB, "tenant": "t", "state": "failed", "error": {**error, "detail": "d"}} for error in errors]
    with serving(lambda request: as_json({"items": jobs})) as server:
        assert run(["status", "--server", server.url]) == 0
        assert run(["admin", "jobs", "--tenant", "t", "-l", "shot=010", "--server", server.url]) == 0
    lines = capsys.readouterr().out.splitlines()
    for listed in (lines[1:3], lines[4:6]):
        assert "failed: unknown-camera" in listed[0]
        assert "failed: memory-limit" in listed[1]
    assert server.asked[-1] == "GET /v1/admin/jobs?limit=200&tenant=t&label=shot%3A010"


@pytest.mark.parametrize(("known", "noted"), [("layout", False), ("layuot", True)])
def test_quotas_of_a_tenant_that_nobody_knows_are_noted(known: str, noted: bool, capsys: pytest.CaptureFixture[str]) -> None:
    share = {"used": 0, "limit": None}
    shares = dict.fromkeys(("queued_jobs", "running_jobs", "stored_bytes", "cpu_s_per_day"), share)
    tenant = {
        "tenant": known,
        **shares,
        "cpu_s_total": 0,
        "requests_per_s": 1,
        "quotas": {"stored_bytes": 3 * 2**20},
        "quotas_set": {},
    }

    def script(request: Request) -> Answer:
        return as_json({"items": [tenant]} if request.path.startswith("/v1/admin/tenants?") else {**tenant, "tenant": "layout"})

    with serving(script) as server:
        assert run(["admin", "quotas", "layout", "--stored-bytes", "3M", "--server", server.url]) == 0
    said = capsys.readouterr()
    assert ("note: a tenant layout has no key, scene or job yet" in said.err) == noted
    assert "stored_bytes    3,145,728" in said.out
    assert json.loads(server.requests[-1].body) == {"stored_bytes": 3 * 2**20}


def test_cancel_and_fetch_of_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with serving(script) as server:
        assert run(["cancel", "job_1", "job_2", "--server", server.url]) == 0
        assert capsys.readouterr().out == "job_1 succeeded\njob_1 succeeded\n"
        assert run(["fetch", "job_1", "--server", server.url]) == 1
        assert "has no such files" in capsys.readouterr().err
        assert run(["submit", "none.usda", "--server", server.url]) == 3
        assert run(["submit", "none.usda", "-l", "nothing", "--server", server.url]) == 2


def test_fetch_replaces_no_file_silently(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = {"a.exr": b"one", "b.exr": b"two"}
    items = [{"name": n, "bytes": 3, "sha256": hashlib.sha256(b).hexdigest(), "media_type": ""} for n, b in made.items()]

    def answer(request: Request) -> Answer:
        name = request.path.rpartition("/")[2]
        if name in made:
            return Answer(200, made[name])
        return as_json({"items": items}) if name.startswith("outputs") else as_json(DONE)

    (tmp_path / "a.exr").write_bytes(b"mine")
    with serving(answer) as server:
        assert run(["fetch", "job_1", "--server", server.url]) == 2
        assert "error: file-exists: other files with these names exist" in capsys.readouterr().err
        assert [(tmp_path / name).read_bytes() for name in made] == [b"mine", b"two"]
        assert run(["fetch", "job_1", "--server", server.url, "--overwrite"]) == 0
        assert [(tmp_path / name).read_bytes() for name in made] == [b"one", b"two"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--limit", "upload_bytes=4X"], "upload_bytes=4X"),
        (["--webhook-network", "10.0.0.1/8"], "10.0.0.1/8"),
        (["--port", "70000"], "--port"),
        (["keys"], ""),
    ],
)
def test_serve_says_what_is_wrong_before_it_starts(arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", *arguments]) == 2
    assert says in capsys.readouterr().err


def test_an_executor_that_there_is_not(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("PRIMRAY_EXECUTOR", "nowhere")
    assert run(["serve"]) == 2
    assert "error: executor: there is no executor 'nowhere'; there are: local" in capsys.readouterr().err


def test_a_data_directory_or_database_that_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from primray_service.store.database import engine

    monkeypatch.setattr(engine, "KEEP_TRYING_S", 0.2)
    (tmp_path / "file").write_text("")
    assert run(["serve", "--data", "file"]) == 1
    assert "cannot be used" in capsys.readouterr().err
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "primray.sqlite").write_text("this is no database" * 100)
    assert run(["serve", "--data", "data"]) == 1
    assert "error: database: the database cannot be used: " in capsys.readouterr().err
    assert run(["keys", "create", "--database", "postgresql+psycopg://u:hidden@127.0.0.1:1/none"]) == 1
    said = capsys.readouterr().err
    assert "cannot be used" in said
    assert "hidden" not in said
    assert run(["keys", "create", "--database", "nonsense://"]) == 1


def test_the_first_key_is_made_without_a_server(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from primray_service.auth import sha256_of
    from primray_service.store import open_store

    assert run(["keys", "create", "--data", "data", "--scopes", "admin", "--tenant", "studio", "--name", "first"]) == 0
    said = capsys.readouterr()
    key = said.out.strip()
    assert key not in said.err
    store = open_store(f"sqlite:///{(tmp_path / 'data' / 'primray.sqlite').resolve()}")
    row = store.key_by_sha256(sha256_of(key))
    store.close()
    assert row is not None
    assert (row.tenant, row.name, row.scopes, row.expires_at) == ("studio", "first", frozenset({"admin"}), None)
    assert run(["keys", "create", "--data", "data", "--scopes", "root"]) == 2
    assert run(["keys", "create", "--data", "data", "--tenant", "../x"]) != 0
