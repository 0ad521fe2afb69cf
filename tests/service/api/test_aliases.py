"""The command line's and the library's words for settings are understood by the API, and the API's by the command line."""

from __future__ import annotations

import inspect
import json
from typing import Any

import pytest
from pydantic import BaseModel

from primray.cli.quick import TABLE
from primray.settings import RenderSettings
from primray_service.api.aliases import STOP_WORDS, WORDS, in_own_words
from primray_service.api.models import JobRequest, Settings, StopRules
from primray_service.http.bodies import parsed
from primray_service.problems import Problem

SCENE = {"id": f"sha256:{'0' * 64}"}
# What the library has and the service does not: it is the server's, or a part of a picture.
NOT_OF_JOBS = {"threads", "max_memory_bytes", "sample_range", "session_layer", "rendering_color_space", "resolution_scale"}
NOT_OF_JOBS |= {"texture_memory_bytes", "texture_cache", "texture_cache_bytes"}
NOT_OF_JOBS |= {"time_code"}  # frames
NOT_OF_JOBS |= {"joint_products"}  # what the library says to itself
NOT_OF_JOBS |= {"label_table"}  # a file that renders of many jobs would write
NOT_OF_JOBS |= {"orbit_deg"}  # views of a turntable
NOT_OF_JOBS |= {"dicing_camera", "surface_textures", "pixel_size"}  # drafts of viewers
NOT_OF_JOBS |= {"deep_samples", "deep_tolerance"}  # jobs refuse deep pictures


def understood(settings: dict[str, Any]) -> Settings:
    return parsed(JobRequest, json.dumps({"scene": SCENE, "settings": settings}).encode()).settings


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ({"spp": 8}, {"stop": {"max_samples": 8}}),
        ({"pixel_samples": 8, "stop": {"target_error": 0.1}}, {"stop": {"max_samples": 8, "target_error": 0.1}}),
        ({"stop": {"spp": 8, "time_limit": 2.5}}, {"stop": {"max_samples": 8, "max_seconds": 2.5}}),
        ({"time_limit_s": 3.0, "error_metric": "rmse"}, {"stop": {"max_seconds": 3.0, "metric": "rmse"}}),
        ({"target_error": 0.01}, {"stop": {"target_error": 0.01}}),
        ({"res": [64, 0], "frame": "1:3"}, {"resolution": [64, 0], "frames": "1:3"}),
        ({"aov": ["depth"], "purpose": ["render"]}, {"aovs": ["depth"], "purposes": ["render"]}),
        ({"variant": ["/a:s=x"], "product": "/p"}, {"variants": ["/a:s=x"], "products": ["/p"]}),
        ({"no_default_light": True}, {"default_light": False}),
        ({"spp": 8, "stop": {"max_samples": 8}}, {"stop": {"max_samples": 8}}),
    ],
)
def test_words_mean_the_apis_members(said: dict[str, Any], meant: dict[str, Any]) -> None:
    assert understood(said) == understood(meant)
    assert understood(said) != Settings()


@pytest.mark.parametrize(
    ("said", "member"),
    [
        ({"spp": 8, "stop": {"max_samples": 9}}, "settings.stop.max_samples"),
        ({"stop": {"spp": 8, "max_samples": 9}}, "settings.stop.max_samples"),
        ({"res": [1, 2], "resolution": [2, 1]}, "settings.resolution"),
        ({"spp": "many"}, "settings.stop.max_samples"),
        ({"spq": 8}, "settings.spq"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_its_member(said: dict[str, Any], member: str) -> None:
    with pytest.raises(Problem) as refused:
        understood(said)
    assert refused.value.as_json()["errors"][0]["member"] == member


@pytest.mark.parametrize("document", [{"settings": {"stop": {"max_samples": 3}, "frames": "1"}}, {"settings": 3}, [], None])
def test_what_has_the_apis_words_stays_as_it_is(document: Any) -> None:
    assert in_own_words(document) is document


def test_every_field_of_the_library_is_understood() -> None:
    members = {*Settings.model_fields, *StopRules.model_fields}
    words = {word for others in (*WORDS.values(), *STOP_WORDS.values()) for word in others}
    fields = inspect.signature(RenderSettings).parameters
    assert set(fields) - members - words == NOT_OF_JOBS


def test_the_command_line_understands_the_apis_words() -> None:
    flags = {flag for _, names in TABLE.values() for flag in names}
    own = [*STOP_WORDS, *(word for word in WORDS if word != "default_light")]
    assert {f"--{word.replace('_', '-')}" for word in own} <= flags


def whole_numbers() -> list[tuple[tuple[str, ...], str]]:
    """The members of a request that hold whole numbers: each one's path, and a value with "N" for the number."""
    found: list[tuple[tuple[str, ...], str]] = []

    def look(model: type[BaseModel], path: tuple[str, ...]) -> None:
        for name, member in model.model_json_schema()["properties"].items():
            inner = model.model_fields[name].annotation
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                look(inner, (*path, name))
            elif '"integer"' in (text := json.dumps(member)):
                found.append(((*path, name), "[N, N]" if "prefixItems" in text else "N"))

    look(JobRequest, ())
    return found


@pytest.mark.parametrize(("path", "value"), whole_numbers(), ids=str)
def test_a_whole_number_may_be_written_with_a_point(path: tuple[str, ...], value: str) -> None:
    """JSON has one kind of number; JSON Schema's integers are those without a fraction."""

    def request(number: str) -> JobRequest:
        text = value.replace("N", number)
        for name in reversed(path):
            text = f'{{"{name}": {text}}}'
        return parsed(JobRequest, f'{{"scene": {json.dumps(SCENE)}, {text[1:]}'.encode())

    assert request("16.0") == request("1.6e1") == request("16")
    for wrong in ("16.5", '"16.0"', "true", "1e300"):
        with pytest.raises(Problem):
            request(wrong)


def test_whole_numbers_of_all_settings_are_found() -> None:
    names = {path[-1] for path, _ in whole_numbers()}
    assert names >= {"max_samples", "seed", "max_depth", "resolution", "priority", "parallel"}
    found = understood({"spp": 16.0, "shutter": [0.0, 0.5], "diffusion": 1.0})
    assert (found.stop.max_samples, found.shutter, found.diffusion) == (16, (0.0, 0.5), 1.0)
    assert type(found.stop.max_samples) is int
