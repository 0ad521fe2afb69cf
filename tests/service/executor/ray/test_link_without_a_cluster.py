"""What is said where there is no Ray to work with: a code, and what to do."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path

import pytest

from primray.cli import run
from primray.errors import SettingsError
from primray_service.config import ServeConfig
from primray_service.executor.ray import link, protocol
from primray_service.executor.ray.executor import RayExecutor
from primray_service.files import DataDirectory
from primray_service.limits import Limits
from primray_service.problems import Problem


def refused(tmp_path: Path, address: str) -> Problem:
    async def start() -> None:
        executor = RayExecutor(DataDirectory(tmp_path), Limits(), address=address)
        try:
            await executor.start()
        finally:
            assert executor.capacity().slots == 0
            assert not executor.health()["ok"]
            await executor.close()

    with pytest.raises(Problem) as raised:
        asyncio.run(start())
    assert raised.value.slug == "unavailable"
    return raised.value


def test_nobody_listens(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="skipped: no ray")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    problem = refused(tmp_path, f"127.0.0.1:{port}")
    assert problem.extra["code"] == protocol.UNREACHABLE
    assert problem.detail == f"no Ray cluster at 127.0.0.1:{port}: Connection refused."


def test_an_address_that_is_none(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="skipped: no ray")
    problem = refused(tmp_path, "ray://head:10001")
    assert problem.extra["code"] == protocol.ADDRESS
    assert "HOST:PORT" in problem.detail


def test_ray_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "find_spec", lambda name: None)
    problem = refused(tmp_path, "auto")
    assert problem.extra["code"] == protocol.NOT_INSTALLED
    assert "primray[ray]" in problem.detail


def test_each_code_is_documented() -> None:
    page = (Path(__file__).parents[4] / "docs/service/scaling.md").read_text()
    codes = (
        protocol.NOT_INSTALLED,
        protocol.ADDRESS,
        protocol.UNREACHABLE,
        protocol.WRONG_TOKEN,
        protocol.NO_NODE,
        "ray-label",
    )
    assert [code for code in codes if f"| `{code}` |" not in page] == []


def test_tokens_are_asked_for_unless_that_was_switched_off() -> None:
    assert link.environment({})["RAY_AUTH_MODE"] == "token"
    assert link.environment({"RAY_AUTH_MODE": "disabled"})["RAY_AUTH_MODE"] == "disabled"


@pytest.mark.parametrize("label", ["pool", "=render", "pool=", "pool=a,b", "pool=in(a)"])
def test_a_label_that_is_none(label: str) -> None:
    with pytest.raises(SettingsError, match="not a node label") as raised:
        ServeConfig(Path("data"), executor="ray", ray_labels=(label,))
    assert raised.value.code == "ray-label"


def test_flags_of_ray_are_for_ray(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", "--ray-address", "head:6379", "--ray-label", "pool=a"]) == 2
    assert "--ray-address, --ray-label requires --executor ray" in capsys.readouterr().err


def test_the_command_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("primray_service.cli.serve.find_spec", lambda name: None)
    assert run(["serve", "--executor", "ray"]) == 1
    assert "error: ray-missing:" in (said := capsys.readouterr().err)
    assert "pip install 'primray[ray]'" in said
