"""Values of options that are written as text."""

from __future__ import annotations

import pytest

from primray.cli.option_values import bytes_of, purposes_of
from primray.errors import SettingsError


@pytest.mark.parametrize(
    ("text", "expected"),
    [("4G", 4 * 2**30), ("500M", 500 * 2**20), ("1.5GiB", 3 * 2**29), ("2k", 2048), ("100", 100), ("1TB", 2**40), (None, None)],
)
def test_amounts_of_memory(text: str | None, expected: int | None) -> None:
    assert bytes_of(text) == expected


@pytest.mark.parametrize("text", ["", "G", "-1G", "4 GG", "1e3", "4X"])
def test_what_is_no_amount(text: str) -> None:
    with pytest.raises(SettingsError, match="4G"):
        bytes_of(text)


def test_purposes() -> None:
    assert purposes_of("default, render") == ("default", "render")
    assert purposes_of(None) is None
