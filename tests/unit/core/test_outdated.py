"""A compiled core that is older than its sources: what fails because of it is reported as that."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from primray.cli import run
from primray.core import native
from primray.core.inputs import filled


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The core's sources, a second older than the compiled core: the path of one of them."""
    built = Path(str(native.module().__file__)).stat().st_mtime - 1
    package = tmp_path / "renderer/primray/core"
    package.mkdir(parents=True)
    source = tmp_path / "renderer/core/scene/fog.hpp"
    source.parent.mkdir(parents=True)
    source.write_text("")
    os.utime(source, (built, built))
    monkeypatch.setattr(native, "__file__", str(package / "native.py"))
    return source


def age(source: Path, seconds: float) -> None:
    built = Path(str(native.module().__file__)).stat().st_mtime
    os.utime(source, (built - seconds, built - seconds))


def test_a_core_without_a_field_that_python_sets(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def inspect(*_: object, **__: object) -> None:
        filled(native.module().FogInput(), no_such_field=1.0)

    monkeypatch.setattr("primray.cli._call", inspect)
    assert run(["inspect", "shot.usda"]) == 1
    assert "this is a bug in primray" in capsys.readouterr().err
    age(checkout, -10)
    assert run(["inspect", "shot.usda"]) == 1
    said = capsys.readouterr().err
    assert "core-outdated: the compiled core is older than its sources" in said
    assert "make setup" in said
    assert "bug" not in said


def test_an_installed_package_has_no_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    native.module()
    monkeypatch.setattr(native, "__file__", str(tmp_path / "a/primray/core/native.py"))
    assert not native.is_outdated()
