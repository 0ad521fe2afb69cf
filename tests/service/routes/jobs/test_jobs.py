"""Jobs over HTTP, on a server that queues and does not render: what is sent, refused, listed, changed."""

from __future__ import annotations

import json
import time

import httpx2
import pytest
from tests.service.api_calls import QUICK, SCENE, Json, problem, stored, submit
from tests.service.conftest import StartServer

from primray_service.admission import fingerprint
from primray_service.api import views
from primray_service.api.models import JobRequest

NO_JOB = "/v1/jobs/job_00000000000000000000000000"
OLD_FINGERPRINT = (
    "905e5e564726e38acfc2c501c5f712472adfacc2cd7cbf2e0dac70f018017cd1"  # of version 0.2.0, for a request of a scene alone
)


@pytest.fixture(scope="module")
def client(start_server: StartServer) -> httpx2.Client:
    return start_server(dispatch=False, warm=False).client()


@pytest.fixture(scope="module")
def scene(client: httpx2.Client) -> str:
    return stored(client)


def post(client: httpx2.Client, scene: str, body: Json | None = None, **headers: str) -> httpx2.Response:
    return client.post("/v1/jobs", json={"scene": {"id": scene}, **(body or {})}, headers=headers)


def test_a_job_is_accepted_and_shown(client, scene):
    answer = post(client, scene, {"settings": {**QUICK, "frames": "1-4"}, "labels": {"shot": "010"}})
    assert answer.status_code == 202
    shown = client.get(answer.headers["location"])
    assert (shown.json(), shown.headers["etag"]) == (answer.json(), answer.headers["etag"])
    job = views.Job.model_validate_json(shown.content)
    assert job.progress.frames is not None
    assert (job.state, job.progress.frames.total, job.labels) == ("queued", 4, {"shot": "010"})
    assert int(shown.headers["retry-after"]) > 0
    progress = shown.json()["progress"]
    zero = ("fraction", "samples_done", "samples_min", "samples_max", "rays", "rays_per_s", "elapsed_s", "pass")
    assert {name: progress[name] for name in zero} == dict.fromkeys(zero, 0), "clients find every member from the start"
    assert (progress["error"], progress["eta_s"], progress["eta_ci95"]) == (None, None, None)
    assert shown.json()["urls"]["continue"].endswith("/continue")


def test_jobs_have_names(client, scene):
    assert post(client, scene, {"name": "Shot 010, take 2 ☂"}).json()["name"] == "Shot 010, take 2 ☂"
    named = post(client, scene, {"settings": {**QUICK, "camera": "/w/cam", "frames": "1-4"}}).json()
    assert named["name"] == "scene cam 1-4"
    assert post(client, scene, {"labels": {"name": "by its label"}}).json()["name"] == "by its label"
    here = f"/v1/jobs/{named['id']}"
    assert client.patch(here, json={"name": "other"}).json()["name"] == client.get(here).json()["name"] == "other"
    assert [job["name"] for job in client.get("/v1/jobs?limit=2").json()["items"]] == ["by its label", "other"]
    for bad in ("", "x" * 256, "a\nb", "a\x7fb", 3):
        assert problem(post(client, scene, {"name": bad}), 422, "invalid-request")["member"] == "name"
        problem(client.patch(here, json={"name": bad}), 422, "invalid-request")
    form = {"file": ("my shot.usda", SCENE + b"# another"), "job": (None, '{"settings": {"camera": "/w/cam"}}')}
    assert client.post("/v1/jobs", files=form).json()["name"] == "my shot cam"


def test_a_key_of_an_earlier_version_stands_for_the_same_request():
    """Whoever adds a member beside settings: NEW_MEMBERS of admission.py."""
    asked = JobRequest.model_validate({"scene": {"id": "sha256:" + "0" * 64}})
    assert fingerprint(asked) == OLD_FINGERPRINT
    assert fingerprint(asked.model_copy(update={"name": "x"})) != OLD_FINGERPRINT
    other = asked.settings.model_copy(update={"auto_camera": "usdrecord"})
    assert fingerprint(asked.model_copy(update={"settings": other})) != OLD_FINGERPRINT


def test_a_job_from_a_form(client):
    parts = {"job": (None, json.dumps({"settings": QUICK, "priority": 7}), "application/json"), "file": ("s.usda", SCENE)}
    answer = client.post("/v1/jobs", files=parts)
    assert answer.status_code == 202, answer.text
    assert answer.json()["priority"] == 7
    only = client.post("/v1/jobs", files={"file": ("s.usda", SCENE)})
    assert (only.status_code, only.json()["scene"]) == (202, answer.json()["scene"])
    assert (
        "job.settings.nothing"
        in problem(
            client.post("/v1/jobs", files={**parts, "job": (None, '{"settings": {"nothing": 1}}')}), 422, "invalid-request"
        )["detail"]
    )
    problem(client.post("/v1/jobs", files={"job": (None, "{}")}), 422, "invalid-request")


@pytest.mark.parametrize(
    ("settings", "member", "limit"),
    [
        ({"frames": "1:1e15"}, "settings.frames", 10_000),
        ({"frames": "1-99999999999999999999"}, "settings.frames", 10_000),
        ({"frames": "0:1x1e-9999999"}, "settings.frames", 10_000),
        ({"frames": ",".join(f"{n}:{n + 999}" for n in range(0, 20_000, 1000))}, "settings.frames", 10_000),
        ({"resolution": [2_000_000, 2_000_000]}, "settings.resolution", 32_768),
        ({"resolution": [30_000, 30_000]}, "settings.resolution", 2**26),
        ({"stop": {"max_samples": 10**12}}, "settings.stop.max_samples", 2**20),
        ({"stop": {"max_seconds": 1e9}}, "settings.stop.max_seconds", 86_400.0),
    ],
)
def test_more_than_is_allowed_is_refused_at_once(client, scene, settings, member, limit):
    began = time.perf_counter()
    document = problem(post(client, scene, {"settings": settings}), 422, "limit-exceeded")
    assert time.perf_counter() - began < 10  # what it asks for would take days
    assert (document["member"], document["limit"]) == (member, limit)
    assert document["detail"].startswith(f"{member}: ")


@pytest.mark.parametrize(
    ("body", "member"),
    [
        ({"settings": {"frames": "first"}}, "settings.frames"),
        ({"settings": {"frames": "1,2,1"}}, "settings.frames"),
        ({"settings": {"frames": "1:2x0"}}, "settings.frames"),
        ({"settings": {"resolution": [0, 0]}}, "settings.resolution"),
        ({"settings": {"resolution": [-3, 4]}}, "settings.resolution"),
        ({"settings": {"stop": {"target_error": 0}}}, "settings.stop.target_error"),
        ({"settings": {"variants": ["red"]}}, "settings.variants"),
        ({"settings": {"mask": []}}, "settings.mask"),
        ({"settings": {"seed": True}}, "settings.seed"),
        ({"settings": {"colour": 1}}, "settings.colour"),
        ({"labels": {"a:b": "c"}}, "labels"),
        ({"priority": 101}, "priority"),
        ({"scene": {"id": "sha256:0"}}, "scene.id"),
    ],
)
def test_what_is_wrong_is_named(client, scene, body, member):
    assert problem(post(client, scene, body), 422, "invalid-request")["member"] == member


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"{", "line 1, column 2"),
        (b'{"priority": 1, "priority": 2}', "'priority' occurs twice"),
        (b'{"ttl_s": NaN}', "NaN"),
        (b'{"ttl_s": 1e999}', "1e999"),
        (b'{"priority": 1%s}' % (b"0" * 5000), "digits"),
        (b'{"labels": {"a": "\\u0000"}}', "NUL"),
        (b'{"labels": {"a": "\\ud800"}}', "surrogate"),
        (b"\xff", "UTF-8"),
        (b"[" * 200_000, "nested too deep"),
    ],
)
def test_what_is_no_json(client, body, said):
    answer = client.post("/v1/jobs", content=body, headers={"content-type": "application/json"})
    assert said in problem(answer, 400, "invalid-json")["detail"]


def test_other_bodies(client):
    problem(client.post("/v1/jobs", content=b"{}", headers={"content-type": "text/plain"}), 415, "unsupported-media-type")
    problem(client.post("/v1/jobs", data={"scene": "x"}), 415, "unsupported-media-type")
    packed = {"content-type": "application/json", "content-encoding": "gzip"}
    problem(client.post("/v1/jobs", content=b"\x1f\x8b", headers=packed), 415, "unsupported-media-type")
    large = b'{"labels": {"a": "' + b"x" * 400_000 + b'"}}'
    problem(client.post("/v1/jobs", content=large, headers={"content-type": "application/json"}), 413, "request-too-large")
    parts = (large[at : at + 10_000] for at in range(0, len(large), 10_000))  # chunked: no length is told
    problem(client.post("/v1/jobs", content=parts, headers={"content-type": "application/json"}), 413, "request-too-large")


def test_a_scene_that_is_not_there(client):
    document = problem(post(client, f"sha256:{'0' * 64}"), 404, "not-found")
    assert document["member"] == "scene.id"


def test_one_job_for_one_idempotency_key(client, scene):
    first = post(client, scene, {"priority": 3}, **{"idempotency-key": "once"})
    again = post(client, scene, {"priority": 3, "labels": {}}, **{"idempotency-key": "once"})
    assert first.json() == again.json()
    assert ("idempotency-replayed" in first.headers, again.headers["idempotency-replayed"]) == (False, "true")
    problem(post(client, scene, {"priority": 4}, **{"idempotency-key": "once"}), 422, "idempotency-key-reused")
    problem(post(client, scene, {}, **{"idempotency-key": "x" * 256}), 422, "invalid-request")
    assert post(client, scene, {"priority": 3}, **{"idempotency-key": "twice"}).json()["id"] != first.json()["id"]


def test_conditional_requests(client, scene):
    job = submit(client, scene)
    here = f"/v1/jobs/{job['id']}"
    etag = client.get(here).headers["etag"]
    for sent in (etag, f"W/{etag}", f'"other", {etag}', "*"):
        unchanged = client.get(here, headers={"if-none-match": sent})
        assert (unchanged.status_code, unchanged.headers["etag"], unchanged.content) == (304, etag, b""), sent
    assert client.get(here, headers={"if-none-match": '"other"'}).status_code == 200
    changed = client.patch(here, json={"priority": 9}, headers={"if-match": etag})
    assert (changed.status_code, changed.json()["priority"]) == (200, 9)
    assert changed.headers["etag"] != etag
    stale = problem(client.patch(here, json={"priority": 1}, headers={"if-match": etag}), 412, "precondition-failed")
    assert changed.headers["etag"] in stale["detail"]
    assert client.get(here).json()["priority"] == 9
    assert client.get(here, headers={"if-none-match": etag}).status_code == 200


def test_a_change_of_labels_and_time_to_live(client, scene):
    job = submit(client, scene, labels={"a": "1", "b": "2"})
    here = f"/v1/jobs/{job['id']}"
    assert client.patch(here, json={"labels": {"c": "3"}}).json()["labels"] == {"c": "3"}
    assert client.patch(here, json={"ttl_s": 60}).json()["ttl_s"] == 60
    assert client.patch(here, json={}).json()["labels"] == {"c": "3"}
    problem(client.patch(here, json={"ttl_s": 1e12}), 422, "limit-exceeded")
    problem(client.patch(here, json={"state": "succeeded"}), 422, "invalid-request")
    problem(client.patch(NO_JOB, json={}), 404, "not-found")


def test_long_polls_end_with_the_news_or_the_time(client, scene):
    job = submit(client, scene)
    here = f"/v1/jobs/{job['id']}"
    etag = client.get(here).headers["etag"]
    began = time.perf_counter()
    waited = client.get(here, headers={"prefer": "wait=1", "if-none-match": etag})
    assert (waited.status_code, waited.headers["preference-applied"]) == (304, "wait=1")
    assert 0.9 < time.perf_counter() - began < 15
    began = time.perf_counter()
    client.post(f"{here}/cancel")
    ended = client.get(here, headers={"prefer": "respond-async, wait=20"})
    assert (ended.status_code, ended.json()["state"]) == (200, "canceled")
    assert "retry-after" not in ended.headers
    still = client.get(here, headers={"prefer": "wait=20", "if-none-match": ended.headers["etag"]})
    assert still.status_code == 304, "nothing is to come of a job that has ended"
    assert time.perf_counter() - began < 15  # of the 20 that it may wait
    late = post(client, scene, {}, prefer="wait=0")
    assert (late.status_code, late.headers["preference-applied"]) == (202, "wait=0")


def test_pages(start_server):
    client = start_server(dispatch=False, warm=False).client()
    scene = stored(client)
    made = [submit(client, scene, labels={"n": str(n % 2), "all": "yes"})["id"] for n in range(7)]
    client.post(f"/v1/jobs/{made[0]}/cancel")

    def listed(query: str) -> list[str]:
        ids, url = [], f"/v1/jobs?limit=3&{query}"
        while url:
            answer = client.get(url)
            views.JobPage.model_validate_json(answer.content)
            ids += [job["id"] for job in answer.json()["items"]]
            link = answer.links.get("next", {}).get("url")
            assert (link is None) == (answer.json()["next_cursor"] is None)
            url = link or ""
        return ids

    assert listed("") == made[::-1]
    assert listed("order=asc") == made
    assert listed("label=n:1&label=all=yes") == made[1::2][::-1]
    assert listed("state=canceled") == made[:1]
    assert listed("state=canceled&state=queued&order=asc") == made
    assert listed(f"scene={scene}&label=n:2") == []
    problem(client.get("/v1/jobs?cursor=here"), 422, "invalid-request")
    problem(client.get("/v1/jobs?state=lost"), 422, "invalid-request")
    problem(client.get("/v1/jobs?label=n"), 422, "invalid-request")
    problem(client.get("/v1/jobs?label=%00:1"), 422, "invalid-request")
    problem(client.get("/v1/jobs?limit=1000"), 422, "invalid-request")


def test_the_end_of_jobs(client, scene):
    job = submit(client, scene)
    here = f"/v1/jobs/{job['id']}"
    problem(client.post(f"{here}/continue", json={}), 409, "conflict")
    canceled = [client.post(f"{here}/cancel").json() for _ in range(2)]
    assert [job["state"] for job in canceled] == ["canceled", "canceled"]
    none = {"total": 1, "queued": 0, "running": 0, "succeeded": 0, "failed": 0, "canceled": 0}
    assert canceled[0]["progress"]["frames"] == {**none, "canceled": 1}
    on = client.post(f"{here}/continue", json={"stop": {"target_error": 0.5}})
    assert (on.status_code, on.json()["state"], on.json()["attempt"]) == (202, "queued", 2)
    assert on.json()["settings"]["stop"]["target_error"] == 0.5
    assert on.json()["progress"]["frames"] == {**none, "queued": 1}
    client.post(f"{here}/cancel")
    as_before = client.post(f"{here}/continue")
    assert (as_before.status_code, as_before.json()["attempt"]) == (202, 3), "without a body: by the rules that it had"
    assert as_before.json()["settings"] == on.json()["settings"]
    problem(client.post(f"{here}/continue", content=b"{}"), 415, "unsupported-media-type")
    for method, path in (("POST", "/cancel"), ("POST", "/continue"), ("DELETE", "")):
        stale = client.request(method, f"{here}{path}", headers={"if-match": '"1.1"'})
        problem(stale, 412, "precondition-failed")
    assert client.get(here).json()["attempt"] == 3
    assert client.delete(here, headers={"if-match": client.get(here).headers["etag"]}).status_code == 204
    for answer in (client.get(here), client.delete(here), client.post(f"{here}/cancel"), client.get(f"{here}/events")):
        problem(answer, 404, "not-found")


def test_frames(client, scene):
    job = submit(client, scene, {**QUICK, "frames": "1:5x2,10.5"})
    here = f"/v1/jobs/{job['id']}/frames"
    first = client.get(f"{here}?limit=3")
    views.FramePage.model_validate_json(first.content)
    rest = client.get(first.links["next"]["url"]).json()
    frames = first.json()["items"] + rest["items"]
    assert [(frame["number"], frame["time_code"]) for frame in frames] == [(0, 1.0), (1, 3.0), (2, 5.0), (3, 10.5)]
    assert rest["next_cursor"] is None
    assert client.get(f"{here}/2").json() == frames[2]
    problem(client.get(f"{here}/4"), 404, "not-found")
    problem(client.get(f"{here}/99999999999999999999"), 422, "invalid-request")
    assert client.get(f"{here}?after=2").json()["items"] == frames[3:]


def test_convergence_of_a_job_that_has_not_begun(client, scene):
    here = f"/v1/jobs/{submit(client, scene)['id']}/convergence"
    assert client.get(here).json() == []
    table = client.get(here, headers={"accept": "text/csv"})
    assert (table.headers["content-type"], table.text) == (
        "text/csv; charset=utf-8",
        "frame,t_s,samples,relmse,ci95_low,ci95_high,rmse\r\n",
    )
    assert table.headers["vary"] == "Accept"
    assert client.get(f"{here}?format=csv").text == table.text
    assert client.get(f"{here}?format=json", headers={"accept": "text/csv"}).json() == []
    problem(client.get(here, headers={"accept": "image/png"}), 406, "not-acceptable")
    problem(client.get(f"{here}?frame=7"), 404, "not-found")


def test_a_webhooks_secret_is_shown_once(client, scene):
    secret = "whsec_" + "A" * 32
    answer = post(client, scene, {"webhook": {"url": "https://example.com/hook", "secret": secret}})
    if answer.status_code == 202:
        assert answer.json()["webhook"]["secret"] == secret
        assert "secret" not in client.get(answer.headers["location"]).json()["webhook"]
    else:
        problem(answer, 422, "webhook-address")  # where no names can be looked up
