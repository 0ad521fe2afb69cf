"""Retry-After as seconds or a date."""

from __future__ import annotations

import pytest

from primray_service.http.retry_after import retry_after_s

NOW = 1_000_000_000.0  # Sun, 09 Sep 2001 01:46:40 GMT


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("5", 5.0),
        (" 0 ", 0.0),
        ("Sun, 09 Sep 2001 01:47:10 GMT", 30.0),
        ("Sun, 09 Sep 2001 01:46:10 GMT", 0.0),
        ("-1", None),
        ("1.5", None),
        ("soon", None),
        ("٥", None),
    ],
)
def test_values(text: str, seconds: float | None) -> None:
    assert retry_after_s({"Retry-After": text}, NOW) == seconds


def test_no_header() -> None:
    assert retry_after_s({}, NOW) is None
