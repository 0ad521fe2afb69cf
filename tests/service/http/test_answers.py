"""Entity tags of conditional requests, media types by Accept, and JSON without numbers that it does not have."""

from __future__ import annotations

import pytest
from starlette.requests import Request

from primray_service.http.answers import accepted, check_match, json_bytes, none_match
from primray_service.problems import Problem


def request(**headers: str) -> Request:
    named = [(name.replace("_", "-").encode(), text.encode()) for name, text in headers.items()]
    return Request({"type": "http", "headers": named})


def test_numbers_that_are_not_finite_are_null() -> None:
    assert json_bytes({"a": [float("nan"), 1.5], "b": (float("inf"),)}) == b'{"a":[null,1.5],"b":[null]}'


@pytest.mark.parametrize(
    ("header", "lacks"),
    [('"1.2"', False), ('W/"1.2"', False), ('"0.1", "1.2"', False), ("*", False), ('"1.3"', True), ("1.2", True)],
)
def test_if_none_match(header: str, lacks: bool) -> None:
    assert none_match(request(if_none_match=header), '"1.2"') is lacks


def test_a_request_without_if_none_match_lacks_the_version() -> None:
    assert none_match(request(), '"1.2"')


def test_if_match_compares_strongly() -> None:
    assert not check_match(request(), '"1.2"')
    assert check_match(request(if_match='"0.1", "1.2"'), '"1.2"')
    for header in ('W/"1.2"', '"1.3"'):
        with pytest.raises(Problem, match="Its version is"):
            check_match(request(if_match=header), '"1.2"')


@pytest.mark.parametrize(
    ("header", "chosen"),
    [
        ("*/*", "image/png"),
        ("image/jpeg", "image/jpeg"),
        ("image/png;q=0.5, image/jpeg;q=0.8", "image/jpeg"),
        ("image/*, image/png;q=0.1", "image/jpeg"),
        ("text/html, */*;q=0.1", "image/png"),
    ],
)
def test_accept(header: str, chosen: str) -> None:
    assert accepted(request(accept=header), "image/png", "image/jpeg") == chosen


def test_what_is_not_accepted_is_a_problem() -> None:
    with pytest.raises(Problem, match=r"image/png and image/jpeg"):
        accepted(request(accept="text/html, image/png;q=0, image/jpeg;q=2"), "image/png", "image/jpeg")
