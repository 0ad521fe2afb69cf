"""docs/blender.md says what the tests beside Cycles hold."""

from __future__ import annotations

from tests.contrib.blender.expected import EXPECTED

from .blender_table import PAGE, ROWS, table, with_table


def test_the_table_is_fresh() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_table(page) == page


def test_each_scene_is_in_one_row() -> None:
    shown = [(row.job, name) for row in ROWS for name in row.scenes()]
    assert len(shown) == len(set(shown))
    assert set(shown) <= {(job, name) for job, names in EXPECTED.items() for name in names}
    assert table().count("±") >= len({job for job, _ in shown})
