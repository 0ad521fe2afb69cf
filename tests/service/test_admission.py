"""From requests to jobs, and from one attempt's stop rules to the next's; pure."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from primray.errors import LimitError, SettingsError
from primray_service.admission import MEMBERS, _member, check_settings, continued, new_job, render_settings, time_codes
from primray_service.api.models import ContinuedRules, JobRequest, Settings, StopRules
from primray_service.jobs import Job, JobState, Json
from primray_service.limits import Limits
from primray_service.problems import Problem

LIMITS = Limits(frames=5, samples=1000)
SCENE = {"id": f"sha256:{'0' * 64}"}


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        (None, [None]),
        ("3", [3]),
        ("1:3", [1, 2, 3]),
        ("1-3", [1, 2, 3]),
        ("-3--1", [-3, -2, -1]),
        ("1-9x2", [1, 3, 5, 7, 9]),
        ("5:1", [5, 4, 3, 2, 1]),
        (" 1 , 4:5 ", [1, 4, 5]),
        ("0:1x0.25", [0, 0.25, 0.5, 0.75, 1]),
    ],
)
def test_frames(text, frames):
    assert time_codes(text, LIMITS) == frames


@pytest.mark.parametrize("text", ["1:6", "1,2,3,4,5,6", "1:3,1:3", "1:1e15", "0:1x1e-9", "0:1x1e-99999", "0:9e99"])
def test_too_many_frames(text):
    with pytest.raises(Problem) as raised:
        time_codes(text, LIMITS)
    assert (raised.value.slug, raised.value.extra["limit"]) == ("limit-exceeded", 5)


@pytest.mark.parametrize("text", ["", "1:", "a", "1:2x0", "1:2:3:4", "1 2", "1,1", "1e9999999999", "1:2x1e9999999999"])
def test_what_is_no_frame_list(text):
    with pytest.raises(Problem) as raised:
        time_codes(text, LIMITS)
    assert raised.value.slug == "invalid-request"


def job(stop: Json, state: JobState = JobState.SUCCEEDED) -> Job:
    request = JobRequest.model_validate({"scene": SCENE, "settings": {"stop": stop}})
    made, _ = new_job(request, request.scene.id or "", "a", LIMITS, 0.0)
    return Job(**{**vars(made), "state": state})


@pytest.mark.parametrize(
    ("before", "asked", "after"),
    [
        ({"target_error": 0.1}, {"target_error": 0.05}, {"target_error": 0.05}),
        ({"max_samples": 16}, {"max_samples": 32}, {"max_samples": 32}),
        ({}, {"max_samples": 65}, {"max_samples": 65}),  # no rule: 64 samples
        ({}, {"target_error": 0.1}, {"target_error": 0.1}),
        ({"max_samples": 16}, {"target_error": 0.1, "max_samples": None}, {"target_error": 0.1}),
        ({"target_error": 0.1, "max_samples": 16}, {"max_samples": None}, {"target_error": 0.1}),
        ({"target_error": 0.1, "max_seconds": 5}, {"max_seconds": 9}, {"target_error": 0.1, "max_seconds": 9}),
        ({"target_error": 0.1}, {"metric": "display", "target_error": 0.2}, {"metric": "display", "target_error": 0.2}),
    ],
)
def test_a_job_that_succeeded_goes_further(before, asked, after):
    found = continued(job(before), ContinuedRules.model_validate(asked), LIMITS)
    empty = {"target_error": None, "metric": None, "max_samples": None, "max_seconds": None}
    assert found == {**empty, **after}


@pytest.mark.parametrize(
    ("before", "asked", "member"),
    [
        ({"target_error": 0.1}, {}, "stop"),
        ({"target_error": 0.1}, {"target_error": 0.1}, "stop"),
        ({"target_error": 0.1}, {"target_error": 0.2}, "stop.target_error"),
        ({"max_samples": 16}, {"max_samples": 8}, "stop.max_samples"),
        ({"max_samples": 16, "target_error": 0.1}, {"max_samples": 8, "target_error": 0.01}, "stop.max_samples"),
        ({}, {"max_samples": 64}, "stop"),
        ({}, {"max_samples": 10}, "stop.max_samples"),
        ({"max_samples": 16}, {"max_samples": 10**6}, "stop.max_samples"),
    ],
)
def test_a_job_that_succeeded_is_not_asked_for_less(before, asked, member):
    with pytest.raises(Problem) as raised:
        continued(job(before), ContinuedRules.model_validate(asked), LIMITS)
    assert raised.value.extra["member"] == member


@pytest.mark.parametrize("state", [JobState.CANCELED, JobState.FAILED, JobState.EXPIRED])
def test_one_that_did_not_reach_its_end_goes_on_as_it_was(state):
    before = {"target_error": 0.1, "metric": "rmse", "max_samples": 16, "max_seconds": None}
    assert continued(job(before, state), ContinuedRules(), LIMITS) == before


@pytest.mark.parametrize(
    ("member", "value"),
    [
        ("products", ["beauty", "/Render/x"]),
        ("products", ["*", "/Render/x"]),
        ("products", ["/Render/x", "/Render/x"]),
        ("compression", "squeeze"),
        ("compression", "zip:much"),
        ("dome", "/etc/passwd"),
        ("dome", "../sky.hdr"),
        ("background", "a/../../b.png"),
    ],
)
def test_products_and_files_that_cannot_be_are_refused_by_name(member, value):
    settings = Settings.model_validate({member: value})
    with pytest.raises(Problem) as refused:
        check_settings(settings, Limits())
    assert refused.value.slug == "invalid-request"
    assert refused.value.extra["member"] == f"settings.{member}"


@pytest.mark.parametrize("value", [["*"], ["/Render/x", "/Render/y"]])
def test_several_products_are_admitted(value):
    check_settings(Settings.model_validate({"products": value}), Limits())


@pytest.mark.parametrize(("member", "value"), [("products", ["Render/side"]), ("render_settings", "S")])
def test_prims_are_named_by_their_paths(member, value):
    with pytest.raises(Problem) as refused:
        check_settings(Settings.model_validate({member: value}), Limits())
    assert refused.value.slug == "invalid-request"
    assert refused.value.extra["member"] == f"settings.{member}"


@pytest.mark.parametrize(
    ("asked", "member"),
    [
        ({"stop": {"max_samples": 0}}, "stop.max_samples"),
        ({"stop": {"target_error": -1}}, "stop.target_error"),
        ({"stop": {"max_seconds": 0}}, "stop.max_seconds"),
        ({"max_depth": 0}, "max_depth"),
        ({"clamp_indirect": -1}, "clamp_indirect"),
        ({"filter_width": 0}, "filter_width"),
        ({"dicing_rate": 0}, "dicing_rate"),
        ({"motion_error": 0}, "motion_error"),
        ({"region": (1, 0, 0, 1)}, "region"),
        ({"lens_flaws": ("foo",)}, "lens_flaws"),
        ({"purposes": ("x",)}, "purposes"),
        ({"variants": ("nonsense",)}, "variants"),
        ({"load": ("car",)}, "load"),
        ({"mask": ()}, "mask"),
        ({"aovs": ("dept",)}, "aovs"),
        ({"fail_on": ("x",)}, "fail_on"),
        ({"allow": ("x",)}, "allow"),
        ({"diffusion_glare": 0.9, "diffusion_starburst": 0.9}, "diffusion_starburst"),
        ({"default_light": False, "studio_light": "on"}, "studio_light"),
        ({"stop_at": "denoised", "stop": {"metric": "display", "target_error": 1}}, "stop_at"),
        ({"stop_at": "mix", "mixes": ("key=2",), "stop": {"metric": "display", "target_error": 1}}, "stop_at"),
        ({"stop_at": "mix", "stop": {"target_error": 1}}, "mixes"),
        ({"mixes": ("key",)}, "mixes"),
    ],
)
def test_a_refusal_names_the_member_by_the_place_that_the_renderer_says(asked, member):
    """Whatever the words of the renderer's message; values that the model refuses do not come so far."""
    stop = StopRules.model_construct(**{**StopRules().model_dump(), **asked.pop("stop", {})})
    settings = Settings.model_construct(**{**dict(Settings()), **asked, "stop": stop})
    with pytest.raises((SettingsError, LimitError)) as found:
        render_settings(settings)
    assert _member(found.value) == f"settings.{member}"


def test_every_member_that_the_renderer_may_refuse_is_in_the_api():
    assert len(MEMBERS) > 40
    for field, member in MEMBERS.items():
        first, *rest = member.split(".")
        assert first in Settings.model_fields, field
        assert all(name in StopRules.model_fields for name in rest), field


def test_render_settings_and_a_product_reach_the_renderer():
    asked = render_settings(Settings.model_validate({"products": ["/Render/side"], "render_settings": "/Render/S"}))
    assert (asked.render_settings, asked.product) == ("/Render/S", "/Render/side")
    assert render_settings(Settings()).product is None


@pytest.mark.parametrize("aovs", [None, [], ["depth", "prim", "primvar:wear"]])
def test_aovs_go_to_the_renderer_as_they_are(aovs):
    settings = Settings.model_validate({"aovs": aovs})
    check_settings(settings, Limits())
    assert render_settings(settings).aovs == (None if aovs is None else tuple(aovs))


def test_an_unknown_aov_is_refused_with_those_that_there_are():
    with pytest.raises(Problem) as refused:
        check_settings(Settings.model_validate({"aovs": ["depth", "smell"]}), Limits())
    assert (refused.value.slug, refused.value.extra["member"]) == ("invalid-request", "settings.aovs")
    assert "smell" in refused.value.detail
    assert "geometric_normal" in refused.value.detail


def test_a_deep_picture_is_refused():
    with pytest.raises(Problem) as refused:
        check_settings(Settings.model_validate({"aovs": ["depth", "deep"]}), Limits())
    assert (refused.value.slug, refused.value.extra["member"]) == ("invalid-request", "settings.aovs")
    assert "checkpoints" in refused.value.detail


def test_a_bad_light_path_expression_is_refused_with_its_place():
    with pytest.raises(Problem) as refused:
        check_settings(Settings.model_validate({"aovs": ["C<RD"]}), Limits())
    assert refused.value.extra["member"] == "settings.aovs"
    assert "character 2" in refused.value.detail


def test_beauty_alone_is_what_there_is():
    check_settings(Settings.model_validate({"aovs": [], "products": ["beauty"], "render_settings": None}), Limits())


def test_a_frame_in_parts_is_not_sampled_adaptively():
    asked = {"scene": {"id": "sha256:" + "0" * 64}, "parallel": "auto"}
    job, _ = new_job(JobRequest.model_validate(asked), "", "t", LIMITS, 0.0)
    assert job.parallel == "auto"
    for adaptive in (False, None):
        new_job(JobRequest.model_validate({**asked, "settings": {"adaptive": adaptive}}), "", "t", LIMITS, 0.0)
    with pytest.raises(Problem) as refused:
        new_job(JobRequest.model_validate({**asked, "settings": {"adaptive": True}}), "", "t", LIMITS, 0.0)
    assert (refused.value.slug, refused.value.extra["member"]) == ("parallel-adaptive", "parallel")


@pytest.mark.parametrize("parallel", [0, 1025, "all", True, 2.0])
def test_parallel_is_a_number_or_auto(parallel):
    with pytest.raises(ValidationError):
        JobRequest.model_validate({"scene": {"id": "sha256:" + "0" * 64}, "parallel": parallel})
