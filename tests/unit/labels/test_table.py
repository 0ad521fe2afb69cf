"""The label table: ids stay, new classes follow, several processes may add to one file, and bad files are refused."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from primray.diagnostics import Diagnostics
from primray.errors import PrimrayError, SettingsError
from primray.labels.table import LabelTable, class_ids, read_table
from primray.settings import RenderSettings


def _ids(path: Path | None, *classes: str) -> tuple[dict[str, int], list[str]]:
    diagnostics = Diagnostics()
    settings = RenderSettings(label_table=None if path is None else str(path))
    table = class_ids(settings, {"class": classes}, diagnostics)
    return dict(table.classes["class"]), [row.message for row in diagnostics]


def test_without_a_file_classes_are_numbered_in_their_order() -> None:
    assert _ids(None, "car", "tree") == ({"car": 1, "tree": 2}, [])


def test_the_first_render_writes_the_file_and_later_ones_add_to_it(tmp_path: Path) -> None:
    path = tmp_path / "labels.json"
    assert _ids(path, "car", "tree") == ({"car": 1, "tree": 2}, [])
    assert json.loads(path.read_text()) == {"classes": {"class": {"car": 1, "tree": 2}}}
    found, told = _ids(path, "bike", "car")
    assert found == {"car": 1, "tree": 2, "bike": 3}
    assert told == ["The label table had no ids of class: bike (3). They are added to it."]
    assert _ids(path, "tree") == (found, [])
    assert [other.name for other in tmp_path.iterdir()] == ["labels.json"]


def test_ids_of_a_user_stay(tmp_path: Path) -> None:
    path = tmp_path / "labels.json"
    path.write_text('{"classes": {"class": {"car": 26, "road": 7}}}')
    assert _ids(path, "car", "kerb")[0] == {"car": 26, "road": 7, "kerb": 27}


def test_a_table_that_has_everything_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "labels.json"
    path.write_text('{"classes": {"class": {"car": 26}}}')
    before = path.stat()
    assert _ids(path, "car") == ({"car": 26}, [])
    assert path.stat().st_ino == before.st_ino


_ADD = """
import sys
from primray.diagnostics import Diagnostics
from primray.labels.table import class_ids
from primray.settings import RenderSettings
for i in range(25):
    class_ids(RenderSettings(label_table=sys.argv[1]), {"class": [f"{sys.argv[2]}{i}", f"shared{i}"]}, Diagnostics())
"""


def test_processes_add_to_one_file_at_the_same_time(tmp_path: Path) -> None:
    path = tmp_path / "labels.json"
    running = [subprocess.Popen([sys.executable, "-c", _ADD, str(path), name]) for name in "abc"]
    assert [one.wait() for one in running] == [0, 0, 0]
    ids = read_table(str(path)).classes["class"]
    assert set(ids) == {f"{name}{i}" for name in ("a", "b", "c", "shared") for i in range(25)}
    assert sorted(ids.values()) == list(range(1, 101))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "is no JSON"),
        ("[]", "is an object"),
        ('{"class": {"car": 1}}', "is an object"),
        ('{"classes": {"class": ["car"]}}', "an object of ids"),
        ('{"classes": {"class": {"car": 0}}}', "ids from 1"),
        ('{"classes": {"class": {"car": true}}}', "ids from 1"),
        ('{"classes": {"class": {"car": 4294967296}}}', "ids from 1"),
        ('{"classes": {"class": {"car": 2, "van": 2}}}', "the id 2 of car is there twice"),
    ],
)
def test_other_files_are_refused(text: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "labels.json"
    path.write_text(text)
    with pytest.raises(SettingsError, match=why) as refusal:
        read_table(str(path))
    assert (refusal.value.code, refusal.value.where) == ("label-table", str(path))
    assert path.read_text() == text


def test_a_file_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(PrimrayError, match="cannot be written") as refusal:
        _ids(tmp_path / "no" / "labels.json", "car")
    assert refusal.value.code == "write-failed"


def test_ids_of_things_that_are_there_remain() -> None:
    table = LabelTable(instances={"class": {"/a": 5}}).with_instances("class", {"/a": 6, "/b": 7})
    assert table.instances == {"class": {"/a": 5, "/b": 7}}
