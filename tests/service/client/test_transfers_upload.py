"""Uploads by content with the Python client against a server: what goes over the line of packages and of a usdz."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.service.api_calls import SCENE, finished, submit
from tests.service.scenes.zips import Entry, zip_of
from tests.service.serving import RunningServer

from primray_service.client import Client
from primray_service.client.transfers import Stretch, _members_of

TEXTURES = {f"tex/{number}.bin": os.urandom(700_000) for number in range(2)}


@pytest.fixture
def client(server: RunningServer) -> Iterator[Client]:
    with Client(server.url) as found:
        yield found


def usdz(path: Path, comment: bytes = b"") -> Path:
    members = [Entry("root.usda", SCENE + comment, align=True)]
    path.write_bytes(zip_of(*members, *(Entry(name, body, align=True) for name, body in TEXTURES.items())))
    return path


def sent_by(client: Client, files: dict[str, Path]) -> tuple[Any, int]:
    most = [0]

    def show(done: int, of: int) -> None:
        assert done <= of
        most[0] = max(most[0], done)

    return client.upload_files(files, name="shot", show=show), most[0]


def test_a_usdz_is_cut_at_its_members(tmp_path: Path) -> None:
    file = usdz(tmp_path / "a.usdz")
    cut = _members_of(Stretch(file, 0, file.stat().st_size))
    assert b"".join(part for stretch in cut for part in stretch.read()) == file.read_bytes()
    bodies = {stretch.size for stretch in cut}
    assert 700_000 in bodies
    with zipfile.ZipFile(file) as package:
        assert len(cut) == 2 * sum(member.file_size > 65_536 for member in package.infolist()) + 1
    other = tmp_path / "b.zip"
    other.write_bytes(file.read_bytes())
    assert _members_of(Stretch(other, 0, other.stat().st_size)) == []
    torn = tmp_path / "torn.usdz"
    torn.write_bytes(file.read_bytes()[:-100])
    assert _members_of(Stretch(torn, 0, torn.stat().st_size)) == []


def test_of_a_usdz_only_what_changed_is_sent(client: Client, server: RunningServer, tmp_path: Path) -> None:
    first, sent = sent_by(client, {"shot.usdz": usdz(tmp_path / "shot.usdz")})
    assert sent > 1_400_000
    again, sent = sent_by(client, {"shot.usdz": tmp_path / "shot.usdz"})
    assert (again.id, sent) == (first.id, 0)
    other, sent = sent_by(client, {"shot.usdz": usdz(tmp_path / "shot.usdz", b"# a comment\n" * 20)})
    assert 0 < sent < 10_000
    with server.client() as http:
        job = finished(http, submit(http, other.id)["id"])
        assert job["state"] == "succeeded", job["error"]
        facts = http.get(f"/v1/scenes/{other.id}").json()
        assert facts["entry"] == "shot.usdz"
        assert http.get("/v1/usage").json()["stored_bytes"]["used"] > 2_800_000  # what was put together is counted


def test_parts_that_are_not_the_file_are_refused(server: RunningServer) -> None:
    import hashlib

    parts = [b"#usda 1.0\n", b"def Sphere {}\n"]
    rows = [{"sha256": hashlib.sha256(part).hexdigest(), "bytes": len(part)} for part in parts]
    whole = {"path": "a.usda", "sha256": "0" * 64, "bytes": sum(map(len, parts)), "parts": rows}
    with server.client() as http:
        for part, row in zip(parts, rows, strict=True):
            assert http.put(f"/v1/contents/{row['sha256']}", content=part).status_code == 201
        answer = http.post("/v1/packages", json={"files": [whole]})
        assert (answer.status_code, answer.json()["type"]) == (422, "/problems/digest-mismatch")
        short = http.post("/v1/packages", json={"files": [{**whole, "bytes": 5}]})
        assert (short.status_code, short.json()["type"]) == (422, "/problems/invalid-request")
        many = http.post("/v1/packages", json={"files": [{**whole, "bytes": 10 * 30_000, "parts": rows[:1] * 30_000}]})
        assert (many.status_code, many.json()["type"]) == (422, "/problems/package-unsafe")


def test_the_command_sends_a_package_by_content(server: RunningServer, tmp_path: Path, capsys: Any) -> None:
    from primray.cli import run

    (tmp_path / "parts.usda").write_bytes(b'#usda 1.0\nover "w"\n{\n}\n')
    scene = tmp_path / "shot.usda"
    scene.write_bytes(SCENE.replace(b"defaultPrim", b"subLayers = [@parts.usda@]\n    defaultPrim", 1))
    before = len(list(server.data.glob("contents/*/*")))
    assert run(["submit", str(scene), "--server", server.url, "--res", "32", "24", "--spp", "4", "--wait"]) == 0
    assert capsys.readouterr().out.startswith("job_")
    assert len(list(server.data.glob("contents/*/*"))) == before + 2
