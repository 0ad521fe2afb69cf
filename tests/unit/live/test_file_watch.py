"""Files that change, come and go are told of once, when they have come to rest."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from primray.live.file_watch import FileWatch


@pytest.fixture
def watch() -> FileWatch:
    return FileWatch(lambda files: None)


def names(found: set[str]) -> set[str]:
    return {Path(file).name for file in found}


def test_a_change_is_told_once_it_rests(watch: FileWatch, tmp_path: Path) -> None:
    files = [tmp_path / "a", tmp_path / "b"]
    for file in files:
        file.write_text("1")
    watch.watch([str(file) for file in files], time.time_ns() + 10**9)
    assert watch.look() == watch.look() == set()
    files[0].write_text("22")
    assert watch.look() == set()
    files[0].write_text("333")
    assert watch.look() == set()  # it is being written
    assert names(watch.look()) == {"a"}
    assert watch.look() == watch.look() == set()


def test_files_that_come_and_go_and_take_the_place_of_others(watch: FileWatch, tmp_path: Path) -> None:
    watch.watch([str(tmp_path / "a")], time.time_ns())
    (tmp_path / "a").write_text("1")
    watch.look()
    assert names(watch.look()) == {"a"}
    (tmp_path / "new").write_text("2")
    os.replace(tmp_path / "new", tmp_path / "a")  # as editors save
    watch.look()
    assert names(watch.look()) == {"a"}
    (tmp_path / "a").unlink()
    watch.look()
    assert names(watch.look()) == {"a"}


def test_what_changed_before_it_was_watched(watch: FileWatch, tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1")
    watch.watch([str(tmp_path / "a")], os.stat(tmp_path / "a").st_mtime_ns - 1)  # it was read before
    watch.look()
    assert names(watch.look()) == {"a"}
    watch.watch([str(tmp_path / "a"), str(tmp_path / "b")], 0)  # known by now
    watch.look()
    assert watch.look() == set()


def test_it_tells_by_itself(tmp_path: Path) -> None:
    told: list[set[str]] = []
    watch = FileWatch(told.append, every_s=0.01)
    watch.watch([str(tmp_path / "a")], time.time_ns())
    watch.start()
    (tmp_path / "a").write_text("1")
    end = time.monotonic() + 10
    while not told and time.monotonic() < end:
        time.sleep(0.01)
    watch.close()
    assert [names(files) for files in told] == [{"a"}]
