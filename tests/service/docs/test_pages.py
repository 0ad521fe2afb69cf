"""The pages under docs/service do what they say: their commands run, in order, against a real server."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.service.serving import RunningServer

from primray.cli import run
from primray_service.cli import COMMANDS
from primray_service.client import Client
from primray_service.problems import KINDS
from primray_service.webhooks.sender import DELAYS_S
from primray_service.webhooks.signing import new_secret, signed_headers

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs/service"
PNG, EXR = b"\x89PNG", b"\x76\x2f\x31\x01"


# A page may ask whether something is there (-sSf); all other answers have to be good ones.
STRICT = """set -euo pipefail
curl() { if [[ $* == *-sSf* ]]; then command curl "$@"; else command curl --fail-with-body "$@"; fi; }
"""


def blocks(page: str, kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", (DOCS / page).read_text(), re.DOTALL | re.MULTILINE)


def bash(script: str, folder: Path, **environment: str) -> str:
    """What it prints; every command in it has to succeed, and every answer too."""
    if shutil.which("curl") is None:
        pytest.skip("skipped: no curl")
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PRIMRAY_")}
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", "-c", STRICT + script]
    done = subprocess.run(
        command, cwd=folder, env=clean | {"PATH": path, **environment}, capture_output=True, text=True, timeout=180
    )
    assert done.returncode == 0, f"{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


def test_the_quick_start(tmp_path: Path) -> None:
    """Exactly its commands, but for the port and a smaller picture; and a user who waits until the server is there."""
    port = free_port()
    script = "".join(blocks("quick-start.md", "sh"))
    assert script.count("primray serve &\n") == 1
    waiting = f"trap 'kill $!; wait $!' EXIT\nuntil command curl -sf http://127.0.0.1:{port}/healthz; do sleep 0.1; done\n"
    script = script.replace("primray serve &\n", f"primray serve --port {port} &\n{waiting}").replace(":8700", f":{port}")
    assert script.count("480, 270") == script.count("480 270") == 1
    script = script.replace("480, 270", "96, 54").replace("480 270", "96 54")
    printed = bash(script, tmp_path, PRIMRAY_DATA=str(tmp_path / "data"), PRIMRAY_SERVER=f"http://127.0.0.1:{port}")
    assert (tmp_path / "beauty.png").read_bytes().startswith(PNG)
    assert (tmp_path / "pictures/beauty.exr").read_bytes().startswith(EXR)
    assert "event: end" in printed
    assert (tmp_path / "data/primray.sqlite").is_file()


def test_its_four_commands_are_four() -> None:
    text = (DOCS / "quick-start.md").read_text()
    before, after = text.index("**1. Start**"), text.index("## The same")
    assert len(re.findall(r"^```sh$", text[before:after], re.MULTILINE)) == 4
    assert re.findall(r"\*\*(\d)\. (\w+)\*\*", text) == [("1", "Start"), ("2", "Submit"), ("3", "Watch"), ("4", "Fetch")]


def test_the_api_guide(server: RunningServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = blocks("quick-start.md", "sh")[0] + "".join(blocks("api.md", "sh"))
    printed = bash(script.replace("http://127.0.0.1:8700", server.url), tmp_path)
    assert next(tmp_path.glob("beauty*.0001.exr")).read_bytes().startswith(EXR)
    assert (tmp_path / "preview.png").read_bytes().startswith(PNG)
    assert "event: end" in printed
    with Client(server.url) as client:
        (job,) = client.jobs()
        assert (job.state, job.attempt, job.labels) == ("succeeded", 2, {"shot": "020"})
    monkeypatch.chdir(tmp_path)
    code = blocks("api.md", "python")[1].replace("http://127.0.0.1:8700", server.url)
    exec(compile(code, "api.md", "exec"), {})
    assert (tmp_path / "pictures/beauty.exr").read_bytes().startswith(EXR)


def test_its_check_of_webhooks() -> None:
    names: dict[str, object] = {}
    exec(compile(blocks("api.md", "python")[0], "api.md", "exec"), names)
    is_ours = names["is_ours"]
    assert callable(is_ours)
    secret, now = new_secret(), int(time.time())
    headers = signed_headers(secret, "msg_1", now, b'{"a":1}')
    assert is_ours(headers, b'{"a":1}', secret)
    assert not is_ours(headers, b'{"a":2}', secret)
    assert not is_ours(headers, b'{"a":1}', new_secret())
    assert not is_ours(signed_headers(secret, "msg_1", now - 3600, b"{}"), b"{}", secret)
    assert is_ours({**headers, "webhook-signature": f"v1a,abc v1,xyz {headers['webhook-signature']}"}, b'{"a":1}', secret)


def test_what_the_guide_names_exists(capsys: pytest.CaptureFixture[str]) -> None:
    text = (DOCS / "api.md").read_text()
    for slug in re.findall(r"`([a-z]+(?:-[a-z]+)+)`", text):
        assert slug in KINDS or slug == "webhook-id", slug
    hours = [
        f"{delay // 3600:g} h" if delay >= 3600 else f"{delay // 60:g} min" if delay >= 60 else f"{delay:g} s"
        for delay in DELAYS_S
    ]
    assert f"after {', '.join(hours[:-1])} and {hours[-1]}" in " ".join(text.split())
    helps = {}
    for name in COMMANDS:
        run([name, "--help"])
        helps[name] = capsys.readouterr().out
    run(["keys", "create", "--help"])
    helps["keys"] += capsys.readouterr().out
    everything = text + (DOCS / "command-line.md").read_text() + (DOCS / "quick-start.md").read_text()
    for name, rest in re.findall(r"primray (serve|submit|status|watch|fetch|cancel|keys)\b([^`\n|]*)", everything):
        for flag in re.findall(r"(?<=\s)--[a-z-]+", rest):
            assert flag in helps[name], f"primray {name} {flag}"


def test_links_lead_somewhere() -> None:
    for page in DOCS.glob("*.md"):
        for link in re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text()):
            assert (DOCS / link).exists(), f"{page.name}: {link}"


STAND_IN = """#!/bin/bash
trap 'sleep 0.2; echo saved; exit 130' TERM
echo "$@"
[[ -e slow ]] && for i in {1..100}; do sleep 0.05; done
exit 0
"""


def test_the_slurm_script(tmp_path: Path) -> None:
    """With a stand-in for primray: one frame, and from its checkpoint where there is one; a signal reaches the renderer."""
    (script,) = blocks("command-line.md", "bash")
    stand_in = tmp_path / "bin/primray"
    stand_in.parent.mkdir()
    stand_in.write_text(STAND_IN)
    stand_in.chmod(0o755)
    environment = {**os.environ, "PATH": f"{stand_in.parent}{os.pathsep}{os.environ['PATH']}", "SLURM_ARRAY_TASK_ID": "7"}
    environment["SLURM_CPUS_PER_TASK"] = "16"

    def start() -> subprocess.Popen[str]:
        return subprocess.Popen(["bash", "-c", script], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True)

    first = start()
    asked = "render shot.usda -o pictures/beauty.####.exr --frames 7 --threads 16 --target-error 0.001"
    asked += " --checkpoint checkpoints/7.prc"
    assert first.communicate(timeout=20)[0].split("\n")[0] == asked
    assert first.returncode == 0
    (tmp_path / "checkpoints/7.prc").write_text("")
    (tmp_path / "slow").write_text("")
    second = start()
    assert second.stdout is not None
    assert second.stdout.readline() == f"{asked} --resume checkpoints/7.prc\n"
    second.terminate()
    assert second.communicate(timeout=20)[0] == "saved\n"
    assert second.returncode == 130


def test_the_example(server: RunningServer, tmp_path: Path) -> None:
    """examples/service_client.py, as somebody runs it."""
    command = [sys.executable, str(ROOT / "examples/service_client.py")]
    environment = os.environ | {"PRIMRAY_SERVER": server.url}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "succeeded" in done.stdout
    assert (tmp_path / "beauty.exr").read_bytes().startswith(EXR)
