"""A request with a misspelt member or value is told what was probably meant, by the function that the command line uses."""

from __future__ import annotations

import json

import pytest

from primray_service.admission import check_settings
from primray_service.api.models import ContinueRequest, FormJob, JobRequest, Settings
from primray_service.http.bodies import parsed
from primray_service.limits import Limits
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
        ({"deadline": 10}, "deadline", "did you mean settings.stop.max_seconds?"),
        ({"settings": {"samples": 10}}, "settings.samples", "did you mean settings.stop.max_samples?"),
        ({"settings": {"stop": {"quality": 1}}}, "settings.stop.quality", "did you mean settings.stop.target_error?"),
        ({"width": 640}, "width", "did you mean settings.resolution?"),
        ({"settings": {"denoiser": True}}, "settings.denoiser", "did you mean settings.denoise?"),
        ({"settings": {"tags": {}}}, "settings.tags", "did you mean labels?"),
    ],
)
def test_what_was_meant(sent: dict[str, object], member: str, hint: str) -> None:
    with pytest.raises(Problem) as raised:
        parsed(JobRequest, json.dumps({"scene": SCENE, **sent}).encode())
    (error,) = raised.value.extra["errors"]
    assert error["member"] == member
    assert error["detail"].endswith(f"; {hint}")
    assert raised.value.detail.endswith(hint)


@pytest.mark.parametrize(
    ("sent", "member", "said"),
    [
        ({"settings": {"exposure": "brighter"}}, "settings.exposure", "Input should be a valid number, or 'auto'"),
        ({"settings": {"exposure": 31}}, "settings.exposure", "Input should be less than or equal to 30, or 'auto'"),
        ({"settings": {"exposure": {}}}, "settings.exposure", "Input should be a valid number, or 'auto'"),
        ({"parallel": "all"}, "parallel", "Input should be a valid integer, or 'auto'"),
        ({"settings": {"aovs": ["depth", 3]}}, "settings.aovs.1", "Input should be a valid string"),
        ({"settings": {"resolution": [3]}}, "settings.resolution.1", "Field required"),
        ({"labels": {"a": 1}}, "labels.a", "Input should be a valid string"),
    ],
)
def test_a_member_is_named_by_its_place_in_the_document(sent: dict[str, object], member: str, said: str) -> None:
    """Pydantic names the branches of a union as parts of the place, and has an error for each branch."""
    with pytest.raises(Problem) as raised:
        parsed(JobRequest, json.dumps({"scene": SCENE, **sent}).encode())
    assert raised.value.extra["errors"] == [{"member": member, "detail": said}]
    assert raised.value.detail == f"{member}: {said}."


def test_an_output_that_there_is_not() -> None:
    with pytest.raises(Problem, match="there is no AOV 'dept'; did you mean depth\\? There are depth, ") as raised:
        check_settings(Settings(aovs=["dept"]), Limits())
    assert raised.value.extra["member"] == "settings.aovs"


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
