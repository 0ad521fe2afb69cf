"""The client and the commands against a real server: scenes sent, pictures fetched, keys, and webhooks that arrive."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from tests.service.serving import RunningServer
from tests.service.webhooks.receiver import answering, receiving
from tests.service.webhooks.verifying import verified

from primray.cli import run
from primray_service.client import Client, ProblemError
from primray_service.client.documents import Settings

from ..conftest import StartServer

SCENE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{
    def Camera "cam"
    {
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "sky"
    {
        float inputs:intensity = 1
    }
    def Sphere "ball"
    {
        double radius = 1
    }
}
"""
QUICK: Settings = {"resolution": (24, 16), "stop": {"max_samples": 16}}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "shot.usda"
    file.write_text(SCENE)
    return file


def test_everything_that_the_client_can_ask(server: RunningServer, scene: Path, tmp_path: Path) -> None:
    with Client(server.url, retries=0) as client:
        uploaded = client.upload(scene)
        assert uploaded.id == f"sha256:{hashlib.sha256(scene.read_bytes()).hexdigest()}"
        assert client.wait_for_scene(uploaded.id, 60).state == "ready"
        assert client.upload(scene).state == "ready"  # known by now
        assert [each.id for each in client.scenes()] == [uploaded.id]

        job = client.submit(uploaded, settings={**QUICK, "frames": "1:2"}, labels={"shot": "010"}, priority=60)
        events = list(client.watch(job.id))
        assert events[0].type == "state"
        assert events[-1].type == "end"
        numbered = [event.id for event in events if event.type != "queue"]  # places in the queue have no number
        assert numbered == sorted(set(numbered))
        assert [event.id for event in client.watch(job.id, after=events[-3].id)] == [event.id for event in events[-2:]]
        job = client.wait(job.id, 60)
        assert (job.state, job.priority, job.labels) == ("succeeded", 60, {"shot": "010"})
        assert job.progress.fraction == 1
        assert job.progress.frames is not None
        assert job.progress.frames.succeeded == 2

        frames = list(client.frames(job.id))
        assert [(frame.number, frame.time_code, frame.state) for frame in frames] == [
            (0, 1.0, "succeeded"),
            (1, 2.0, "succeeded"),
        ]
        assert client.frame(job.id, 1) == frames[1]
        curve = client.convergence(job.id, 0)
        assert curve[-1].samples == 16
        assert client.preview(job.id).startswith(b"\x89PNG")
        assert isinstance(client.log(job.id), str)
        outputs = client.outputs(job.id)
        assert outputs
        for output in outputs:
            file = client.download(job.id, output, tmp_path)
            assert hashlib.sha256(file.read_bytes()).hexdigest() == output.sha256
        assert len({output.name for output in outputs}) == len(outputs)

        assert client.change(job.id, labels={"shot": "020"}).labels == {"shot": "020"}
        assert [each.id for each in client.jobs(labels={"shot": "020"})] == [job.id]
        assert list(client.jobs(state="failed")) == []
        gone_on = client.continue_(job.id, {"max_samples": 32})
        assert gone_on.attempt == 2
        ends = [event.data.get("attempt") for event in client.watch(job.id) if event.type == "end"]
        assert ends == [1, 2]
        assert client.convergence(job.id, 0)[-1].samples == 32

        long = client.submit(uploaded.id, settings={"stop": {"max_seconds": 300.0}})
        assert client.cancel(long.id).state in ("canceling", "canceled")
        assert client.wait(long.id, 30).state == "canceled"
        for each in (job.id, long.id):
            client.delete(each)
            with pytest.raises(ProblemError):
                client.job(each)
        client.delete_scene(uploaded.id)
        assert client.find_scene(uploaded.id) is None
        usage = client.usage()
        assert usage.running_jobs.used == 0
        assert usage.cpu_s_total > 0
        assert client.whoami()["tenant"] == "local"
        assert "limits" in client.capabilities()


def test_a_job_is_made_once_whatever_happens_to_the_answers(server: RunningServer, scene: Path) -> None:
    with Client(server.url) as client:
        uploaded = client.upload(scene)
        jobs = {client.submit(uploaded, settings=QUICK, idempotency_key="once-and-for-all").id for _ in range(3)}
        assert len(jobs) == 1
        with pytest.raises(ProblemError) as caught:
            client.submit(uploaded, idempotency_key="once-and-for-all")
        assert caught.value.slug == "idempotency-key-reused"
        client.wait(jobs.pop(), timeout_s=60)


@pytest.fixture(scope="module")
def keyed(start_server: StartServer) -> RunningServer:
    """One that wants keys, and calls webhooks here."""
    return start_server(require_keys=True, webhook_networks=["127.0.0.0/8"], webhook_http=True)


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


Command = Callable[..., Done]


@pytest.fixture
def primray(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The command line, with these variables alone of its own."""

    def command(*arguments: str, **environment: str) -> Done:
        for name in ("PRIMRAY_SERVER", "PRIMRAY_API_KEY", "PRIMRAY_API_KEY_FILE"):
            monkeypatch.delenv(name, raising=False)
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        capsys.readouterr()
        code = run(list(arguments))
        return Done(code, *capsys.readouterr())

    return command


def test_a_scene_of_several_files_is_sent_and_its_pictures_come_back(
    server: RunningServer, primray: Command, tmp_path: Path
) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/world.usda").write_text(SCENE)
    shot = tmp_path / "shots/shot.usda"
    shot.parent.mkdir()
    shot.write_text("#usda 1.0\n(subLayers = [@../lib/world.usda@])\n")
    asked = ["--res", "24", "16", "--spp", "16", "--fetch", str(tmp_path / "out"), "--label", "shot=010"]
    done = primray("submit", str(shot), *asked, PRIMRAY_SERVER=server.url)
    assert done.returncode == 0, done.stderr
    job_id, *files = done.stdout.splitlines()
    assert job_id.startswith("job_")
    assert sorted(Path(file).name for file in files) == sorted(os.listdir(tmp_path / "out"))
    assert any(file.endswith(".exr") for file in files)
    assert "note: ../lib/world.usda: is outside the scene's folder; it is sent as well" in done.stderr
    shown = primray("status", job_id, PRIMRAY_SERVER=server.url)
    assert "succeeded" in shown.stdout
    assert "shot=010" in shown.stdout
    again = primray("fetch", job_id, "-o", str(tmp_path / "again"), "--only", "*.exr", "--json", PRIMRAY_SERVER=server.url)
    (line,) = [json.loads(text) for text in again.stdout.splitlines()]
    assert Path(line["path"]).read_bytes() == (tmp_path / "out" / line["name"]).read_bytes()
    watched = primray("watch", job_id, "--json", PRIMRAY_SERVER=server.url)
    assert watched.returncode == 0
    assert json.loads(watched.stdout.splitlines()[-1])["state"] == "succeeded"


def test_a_scene_that_is_refused_and_a_request_that_is_too_much(
    server: RunningServer, primray: Command, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.usda"
    bad.write_text("#usda 1.0\ndef {\n")
    done = primray("submit", str(bad), PRIMRAY_SERVER=server.url)
    assert done.returncode == 3
    package = tmp_path / "bad.usdz"
    package.write_bytes(b"this is no package")
    done = primray("submit", str(package), PRIMRAY_SERVER=server.url)
    assert done.returncode == 3
    assert "error: not-usd:" in done.stderr
    good = tmp_path / "good.usda"
    good.write_text(SCENE)
    done = primray("submit", str(good), "--frames", "1:1000000", "--json", PRIMRAY_SERVER=server.url)
    assert done.returncode == 4
    assert json.loads(done.stdout)["code"] == "limit-exceeded"
    done = primray("submit", str(good), "--camera", "/no/such", "--wait", PRIMRAY_SERVER=server.url)
    assert done.returncode == 2  # as `primray render` ends
    assert "Traceback" not in done.stderr


def test_keys(keyed: RunningServer, primray: Command) -> None:
    """The first is made in the data directory while the server runs; that one makes and revokes others over HTTP."""
    server = keyed
    assert "Set PRIMRAY_API_KEY" in primray("status", PRIMRAY_SERVER=server.url).stderr
    scene = server.data / "shot.usda"
    scene.write_text("#usda 1.0\n")
    unsent = primray("submit", str(scene), PRIMRAY_SERVER=server.url)  # whose first request is a HEAD, refused without a word
    assert unsent.returncode == 1
    assert unsent.stderr.startswith(
        "error: unauthenticated: the server wants an API key, and none was sent. Set PRIMRAY_API_KEY"
    )
    made = primray("keys", "create", "--data", str(server.data), "--scopes", "admin", "--name", "first")
    assert made.returncode == 0, made.stderr
    admin = {"PRIMRAY_SERVER": server.url, "PRIMRAY_API_KEY": made.stdout.strip()}
    other = primray("keys", "create", "--tenant", "studio", "--scopes", "read", "--days", "1", "--json", **admin)
    key = json.loads(other.stdout)
    studio = {"PRIMRAY_SERVER": server.url, "PRIMRAY_API_KEY": key["key"]}
    assert primray("status", **studio).returncode == 0
    refused = primray("submit", __file__, **studio)
    assert refused.returncode != 0
    listed = primray("keys", "list", **admin).stdout.splitlines()
    assert len(listed) >= 3
    assert any("studio" in line and "until 20" in line for line in listed)
    assert key["key"] not in "".join(listed)
    assert primray("keys", "revoke", key["id"], **admin).returncode == 0
    assert "does not accept it" in primray("status", **studio).stderr
    assert primray("keys", "list", **studio).returncode == 1


def test_a_webhook_arrives_signed(keyed: RunningServer, primray: Command, scene: Path) -> None:
    key = primray("keys", "create", "--data", str(keyed.data)).stdout.strip()
    with receiving(answering(204)) as receiver, Client(keyed.url, key) as client:
        uploaded = client.upload(scene)
        job = client.submit(uploaded, settings=QUICK, webhook={"url": receiver.url(), "events": ["started", "completed"]})
        assert job.webhook is not None
        secret = job.webhook["secret"]
        job = client.wait(job.id, 60)
        assert job.webhook is not None
        assert "secret" not in job.webhook
        until = time.monotonic() + 20
        while len(receiver.received) < 2 and time.monotonic() < until:
            time.sleep(0.05)
    types = []
    for request in receiver.received:
        message = verified(request.headers, request.body, secret, time.time())
        assert message["data"]["id"] == job.id
        types.append(message["type"])
    assert sorted(types) == ["job.completed", "job.started"]


@pytest.mark.parametrize(
    "url", ["http://example.com/", "https://127.0.0.1/", "https://169.254.169.254/x", "https://[::1]/", "https://u@x.org/"]
)
def test_a_webhook_to_a_private_address_is_refused(server: RunningServer, scene: Path, url: str) -> None:
    with Client(server.url) as client:
        uploaded = client.upload(scene)
        before = len(list(client.jobs()))
        with pytest.raises(ProblemError) as caught:
            client.submit(uploaded, settings=QUICK, webhook={"url": url})
        assert (caught.value.slug, caught.value.status) == ("webhook-address", 422)
        assert len(list(client.jobs())) == before


def test_a_job_that_ends_above_its_target_is_an_exit_code_of_its_own(
    server: RunningServer, scene: Path, primray: Command
) -> None:
    flags = ["--res", "24", "16", "--target-error", "1e-9", "--spp", "16", "--wait"]
    done = primray("submit", str(scene), *flags, PRIMRAY_SERVER=server.url)
    assert done.returncode == 5
    assert "target-missed" in done.stderr
    canceled = primray("cancel", done.stdout.strip(), PRIMRAY_SERVER=server.url)
    assert canceled.returncode == 1
    assert "conflict" in canceled.stderr
