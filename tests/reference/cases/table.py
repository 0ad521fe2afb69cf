"""All cases, in the order of docs/light-accuracy.md."""

from __future__ import annotations

from tests.reference.cases.pictured_cases import pictured_cases
from tests.reference.cases.plane_cases import (
    Case,
    control_cases,
    cylinder_cases,
    disk_cases,
    distant_cases,
    placed_cases,
    rect_cases,
    sphere_cases,
)
from tests.reference.cases.shaped_cases import shaped_cases


def cases() -> list[Case]:
    made = [
        *sphere_cases(), *disk_cases(), *rect_cases(), *cylinder_cases(), *distant_cases(), *pictured_cases(),
        *control_cases(), *shaped_cases(), *placed_cases(),
    ]  # fmt: skip
    names = [c.id for c in made]
    assert len(set(names)) == len(names), sorted(n for n in names if names.count(n) > 1)
    return made
