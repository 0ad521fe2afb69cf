"""The server's executor is the one that its configuration names, imported only then."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

from primray.errors import SettingsError
from primray_service.config import ServeConfig
from primray_service.executor import base
from primray_service.executor.local import LocalExecutor
from primray_service.files import DataDirectory


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(SettingsError, match=r"no executor 'nowhere'; there are: local, ray$"):
        ServeConfig(Path("data"), executor="nowhere")


def test_the_default_runs_here(tmp_path: Path) -> None:
    config = ServeConfig(tmp_path, slots=3, cores=6)
    executor = base.executor_maker(config.executor)(config, DataDirectory(tmp_path))
    assert isinstance(executor, LocalExecutor)
    assert (executor.capacity().slots, executor.capacity().cores) == (3, 6)


def test_another_costs_a_file_and_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base, "EXECUTORS", {**base.EXECUTORS, "far": "far_away:far_executor"})
    config = ServeConfig(Path("data"), executor="far")  # nothing is imported yet
    module = ModuleType("far_away")
    module.far_executor = lambda config, data: (config.executor, data)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "primray_service.executor.far_away", module)
    assert base.executor_maker(config.executor)(config, "data") == ("far", "data")
