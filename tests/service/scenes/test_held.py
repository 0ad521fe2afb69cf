"""What is made while a sweep goes through its folder is not lost: uploads' folders, and executors' locks."""

from __future__ import annotations

import asyncio
import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from primray_service.executor.slots import Slots
from primray_service.files import DataDirectory
from primray_service.held import make_held
from primray_service.scenes.staging import staging, sweep


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
