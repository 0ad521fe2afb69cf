"""Plain types of settings' values, which flags and members of the API are read as."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .camera_choice import camera_choice, camera_itself, read_lens_flaws
from .setting import Reader, Row, choice, file, four_numbers, number, pair, text, texts, two_numbers, whole, yes_or_no

FORMS: Mapping[Reader, Any] = {
    whole: int,
    number: float,
    yes_or_no: bool,
    text: str,
    file: str,
    camera_choice: str,
    camera_itself: str,
    texts: list[str],
    read_lens_flaws: list[str],
    pair: tuple[int, int],
    two_numbers: tuple[float, float],
    four_numbers: tuple[float, float, float, float],
}


def form_of(row: Row) -> Any:
    """Return the plain type of a setting's value; that of a choice is its enum."""
    return row.read.kinds if isinstance(row.read, choice) else FORMS[row.read]
