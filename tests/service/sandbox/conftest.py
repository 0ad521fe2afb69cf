"""Each test of what holds inside the sandbox runs twice: in a worker started as a program, and in a forked one."""

from __future__ import annotations

import pytest
from tests.service.sandbox import inside


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "run_inside" in metafunc.function.__code__.co_names:
        metafunc.parametrize("start", ["started", "forked"], indirect=True)


@pytest.fixture(autouse=True)
def start(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inside, "FORKS", getattr(request, "param", "started") == "forked")
