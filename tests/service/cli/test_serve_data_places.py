"""Where `primray serve` keeps things: a folder, or an object store with a folder of copies."""

from __future__ import annotations

from pathlib import Path

import pytest

from primray_service.cli import serve
from primray_service.cli.exits import CommandError


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PRIMRAY_DATA", "PRIMRAY_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/home/somebody")


def test_a_folder_is_a_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    assert serve.places("here", None) == (Path("here"), None)
    monkeypatch.setenv("PRIMRAY_DATA", "/srv/primray")
    assert serve.places(None, None) == (Path("/srv/primray"), None)
    with pytest.raises(CommandError, match="--cache requires an object store"):
        serve.places("here", Path("there"))


def test_an_object_store_comes_with_a_folder_for_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    folder, url = serve.places("s3://bucket/studio", None)
    assert (folder.parent, url) == (Path("/home/somebody/.cache/primray"), "s3://bucket/studio")
    assert serve.places("s3://bucket/other", None)[0] != folder
    assert serve.places("s3://bucket/studio", Path("/fast")) == (Path("/fast"), url)
    monkeypatch.setenv("PRIMRAY_CACHE", "/copies")
    monkeypatch.setenv("PRIMRAY_DATA", "memory://x")
    assert serve.places(None, None) == (Path("/copies"), "memory://x")


def test_without_fsspec_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, "find_spec", lambda name: None)
    with pytest.raises(CommandError, match=r"primray\[objects\]"):
        serve.places("s3://bucket/studio", None)
