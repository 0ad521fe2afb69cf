"""A request with a misspelt member or value is told what was probably meant, by the function that the command line uses."""

from __future__ import annotations

import json

import pytest

from primray_service.api.models import ContinueRequest, FormJob, JobRequest
from primray_service.http.bodies import parsed
from primray_service.problems import Problem

SCENE = {"id": "sha256:" + "0" * 64}


@pytest.mark.parametrize(
    ("sent", "member", "hint"),
    [
        ({"priorty": 60}, "priorty", "did you mean priority?"),
        ({"settings": {"resolutoin": [640, 360]}}, "settings.resolutoin", "did you mean resolution?"),
        ({"settings": {"stop": {"max_sample": 4}}}, "settings.stop.max_sample", "did you mean max_samples?"),
        ({"settings": {"stop": {"camera": "/cam"}}}, "settings.stop.camera", "did you mean settings.camera?"),
        ({"settings": {"parallel": 3}}, "settings.parallel", "did you mean parallel?"),
        ({"settings": {"filter": "gausian"}}, "settings.filter", "did you mean gaussian?"),
        ({"settings": {"stop": {"metric": "relms"}}}, "settings.stop.metric", "did you mean relmse?"),
    ],
)
def test_what_was_meant(sent: dict[str, object], member: str, hint: str) -> None:
    with pytest.raises(Problem) as raised:
        parsed(JobRequest, json.dumps({"scene": SCENE, **sent}).encode())
    (error,) = raised.value.extra["errors"]
    assert error["member"] == member
    assert error["detail"].endswith(f"; {hint}")
    assert raised.value.detail.endswith(hint)


def test_nothing_near_means_no_hint() -> None:
    with pytest.raises(Problem, match="not permitted") as raised:
        parsed(JobRequest, json.dumps({"scene": SCENE, "zzzzzzzz": 1}).encode())
    assert "did you mean" not in raised.value.detail
    with pytest.raises(Problem) as raised:
        parsed(ContinueRequest, b'{"stop": 3}')
    assert "did you mean" not in raised.value.detail


def test_a_forms_job_has_the_hint_below_its_name() -> None:
    with pytest.raises(Problem) as raised:
        parsed(FormJob, b'{"settings": {"camra": "/cam"}}', "job")
    assert raised.value.extra["member"] == "job.settings.camra"
    assert raised.value.detail.endswith("did you mean camera?")
