"""What is made while a sweep goes through its folder is not lost: uploads' folders, and executors' locks."""

from __future__ import annotations

import asyncio
import fcntl
import os
import stat
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from primray_service.executor.slots import Slots
from primray_service.files import DataDirectory, make_held
from primray_service.scenes.preparing import locked
from primray_service.scenes.staging import staging, sweep

self_test_module = import_module("primray_service.sandbox.self_test")


def at_moment(monkeypatch: pytest.MonkeyPatch, moment: str, sweeps: Callable[[], Any]) -> None:
    """`sweeps` runs once, before a thing just made is opened, or between that and its lock."""
    module, name = {"before it is opened": (os, "open"), "before it is locked": (fcntl, "flock")}[moment]
    real = getattr(module, name)

    def patched(*arguments: Any, **options: Any) -> Any:
        monkeypatch.setattr(module, name, real)
        sweeps()
        return real(*arguments, **options)

    monkeypatch.setattr(module, name, patched)


@pytest.mark.parametrize("moment", ["before it is opened", "before it is locked"])
def test_an_upload_that_begins_during_a_sweep_has_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    data = DataDirectory(tmp_path / "data")
    data.incoming.mkdir(parents=True)
    at_moment(monkeypatch, moment, lambda: sweep(data.incoming))

    async def upload() -> None:
        async with staging(data) as staged:
            (staged / "upload").write_text("here")
            assert sweep(data.incoming) == 0
            assert (staged / "upload").exists()

    asyncio.run(upload())
    assert not list(data.incoming.iterdir())


def test_an_executor_that_opens_during_another_s_sweep_keeps_its_slots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slots, other = Slots(tmp_path, "one"), Slots(tmp_path, "two")
    at_moment(monkeypatch, "before it is locked", other.open)
    slots.open()
    slot = slots.make()
    Slots(tmp_path, "three").open()
    assert slot.job.is_dir()


def test_a_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "lock"
    with pytest.raises(FileNotFoundError):
        make_held(lambda: (path, os.open(path, os.O_CREAT | os.O_RDWR)))


def test_the_sandboxs_self_test_is_not_swept_away_by_a_server_that_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = self_test_module._run

    def run(slot: Path, *rest: Any) -> Any:
        Slots(tmp_path, "other").open()
        assert slot.is_dir()
        return real(slot, *rest)

    monkeypatch.setattr(self_test_module, "_run", run)
    found = self_test_module.self_test(tmp_path)
    assert "file" not in (found.problem or ""), found
    assert found.attempts
    assert [path.name for path in tmp_path.iterdir()] == ["other.lock"]


def test_locks_are_of_files_that_are_open_for_writing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Others are not seen by other machines where the data directory is mounted by several (flock(2), on NFS)."""
    real, taken = fcntl.flock, list[str]()

    def flock(handle: int, operation: int) -> None:
        taken.append(os.readlink(f"/proc/self/fd/{handle}"))
        assert stat.S_ISREG(os.fstat(handle).st_mode), taken[-1]
        assert fcntl.fcntl(handle, fcntl.F_GETFL) & os.O_RDWR, taken[-1]
        real(handle, operation)

    monkeypatch.setattr(fcntl, "flock", flock)
    data = DataDirectory(tmp_path / "data")
    data.create()

    async def upload() -> None:
        async with staging(data):
            sweep(data.incoming)
            with locked(data):
                Slots(data.slots, "one").open()
                Slots(data.slots, "two").open()
        self_test_module.self_test(data.slots)

    asyncio.run(upload())
    assert len(taken) >= 6


def test_what_a_dead_server_left_is_swept_away(tmp_path: Path) -> None:
    data = DataDirectory(tmp_path / "data")
    data.create()
    for name in ("upload-1", "gone-2"):
        (data.incoming / name / "package").mkdir(parents=True)
    (data.incoming / "upload-1.lock").touch()
    (data.incoming / "upload-3.lock").touch()
    assert sweep(data.incoming) == 3
    assert not list(data.incoming.iterdir())
