"""Exports of the add-on that keep what has not changed since the last frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from . import host

FRAMES = (1, 2, 3, 3)
# Of 16 objects and 10 materials: at the second frame one material changes and two objects move; at the third one object deforms
# and one appears.
CHANGED = ({"objects": 16, "materials": 10}, {"objects": 0, "materials": 1}, {"objects": 2, "materials": 0},
           {"objects": 0, "materials": 0})  # fmt: skip


def test_a_frame_exports_what_has_changed_and_its_bits_are_those_of_a_whole_export(blender: str, tmp_path: Path) -> None:
    rows: dict[str, list[dict[str, Any]]] = {"after others": [], "alone": []}
    for row in host.run("animation", tmp_path):
        rows[row["name"]].append(row)
    assert [row["frame"] for row in rows["after others"]] == [row["frame"] for row in rows["alone"]] == list(FRAMES)
    assert [row["exported"] for row in rows["after others"]] == list(CHANGED)
    assert [row["exported"] for row in rows["alone"]] == [CHANGED[0]] * len(FRAMES)
    pictures = []
    for kept, alone in zip(rows["after others"], rows["alone"], strict=True):
        pictures.append(host.read(kept["file"]))
        assert (pictures[-1] == host.read(alone["file"])).all(), kept["frame"]
        assert kept["notes"] == alone["notes"]
    assert (pictures[0] != pictures[1]).any()
    assert (pictures[1] != pictures[2]).any()
    assert (pictures[2] == pictures[3]).all()
