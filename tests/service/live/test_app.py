"""What the viewer's server answers, and to whom."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import httpx2
import pytest

from .conftest import write_stage


def test_nothing_is_answered_without_the_secret_or_by_another_name(start):
    running = start()
    parts = urlsplit(running.url)
    origin = f"http://{parts.netloc}"
    assert len(parts.path.strip("/")) >= 24
    with httpx2.Client() as client:
        for path in ("/", "/events", "/picture", "/stage", "/x/", "/x/picture", "/x/events"):
            assert client.get(origin + path).status_code == 404
        assert client.post(f"{origin}/x/commands", json={"do": "frame"}).status_code == 404
        for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example"):
            assert client.get(running.url, headers={"host": host}).status_code == 404
        page = client.get(running.url)
        assert page.status_code == 200
        assert "default-src 'self'" in page.headers["content-security-policy"]
        assert client.get(f"{running.url}stage").json() == {"name": "shot.usda"}
        for name in ("view/view.js", "view/view.css", "page/base/dom.js", "page/style/base.css"):
            assert client.get(running.url + name).status_code == 200
        for name in ("view/app.py", "view/..%2fapp.py", "page/..%2f..%2fapp.py", "page/nothing.js"):
            assert client.get(running.url + name).status_code == 404


def test_commands_are_checked(start):
    running = start()
    commands = f"{running.url}commands"
    with httpx2.Client() as client:
        assert client.post(commands, json={"do": "frame"}).status_code == 204
        for body in ({"do": "jump"}, {"do": "tumble", "across": "far"}, {"do": "exposure", "stops": "bright"}):
            refused = client.post(commands, json=body)
            assert (refused.status_code, refused.json()["type"]) == (400, "/problems/view-command")
        assert client.post(commands, json=[1]).status_code == 400
        how = {"content-type": "application/json"}
        assert client.post(commands, content=b"{", headers=how).status_code == 400
        assert client.post(commands, content=b" " * 20_000, headers=how).status_code == 413
        # A form of another site's page can send this without asking; the type above it cannot.
        assert client.post(commands, content=b'{"do": "reset"}', headers={"content-type": "text/plain"}).status_code == 415


@pytest.mark.parametrize(
    ("name", "flags", "code", "rc"),
    [
        ("tri.obj", [], "stage-format", 3),
        ("nosuch.usda", [], "stage-open", 3),
        ("shot.usda", ["--variant", "/world:paint=green"], "unknown-variant", 2),
    ],
)
def test_a_stage_that_cannot_be_opened_is_refused_before_anything_is_served(
    tmp_path: Path, name: str, flags: list[str], code: str, rc: int
):
    write_stage(tmp_path)
    (tmp_path / "tri.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    asked = [str(Path(sys.executable).with_name("primray")), "view", str(tmp_path / name), "--no-open", *flags]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == rc
    assert code in done.stderr
    assert done.stdout == ""


def test_what_cannot_be_chosen_is_told_with_the_last_picture(start):
    running = start()
    with httpx2.Client(timeout=60) as client, client.stream("GET", f"{running.url}events") as events:
        states = (json.loads(line.removeprefix("data: ")) for line in events.iter_lines() if line.startswith("data: "))
        next(state for state in states if state["phase"] == "finished")
        command = {"do": "variant", "prim": "/world", "set": "paint", "name": "green"}
        client.post(f"{running.url}commands", json=command)
        failed = next(state for state in states if state["phase"] == "failed")
        assert failed["problem"]["code"] == "unknown-variant"
        assert "red" in failed["problem"]["message"]
        assert failed["picture"] > 0
        assert client.get(f"{running.url}picture").status_code == 200


@pytest.mark.parametrize(
    ("flags", "code"),
    [
        (["--spp", "0"], "settings-error"),
        (["--frames", "1:3"], "frames"),
        (["--view", "none such"], "unknown-view"),
        (["--exposure", "bright"], "settings-error"),
    ],
)
def test_flags_are_checked_before(flags: list[str], code: str, tmp_path: Path) -> None:
    program = Path(sys.executable).with_name("primray")
    done = subprocess.run(
        [program, "view", tmp_path / "s.usda", "--no-open", *flags], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert f"error: {code}" in done.stderr
