"""Files of a worker that lives are copied: what it does to them later reaches nobody."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from primray_service.dispatcher.chunks.adoption import NotAdopted, adopt_outputs
from primray_service.dispatcher.chunks.messages import MadeFile
from primray_service.executor.base import Ended
from primray_service.files import adopt_copy


def test_what_it_writes_later_is_not_taken(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    with open(out / "picture", "wb", buffering=0) as file:
        file.write(b"picture")
        ended = Ended("exited", 0, None, out, 0.0, 0, "", lives=True)
        made = MadeFile("beauty.png", "picture", hashlib.sha256(b"picture").hexdigest(), "image/png")
        [(adopted, kept)] = adopt_outputs([made], ended, tmp_path / "frame", 100, "c1")
        file.seek(0)
        file.write(b"changed")
    assert adopted.bytes == 7
    assert kept.read_bytes() == b"picture"
    assert sorted(path.name for path in kept.parent.iterdir()) == ["output-0-c1"]
    assert list(out.iterdir()) == []


@pytest.mark.parametrize("kind", ["link", "second name", "pipe", "folder", "large", "missing"])
def test_only_plain_files_are_taken(tmp_path: Path, kind: str) -> None:
    source, secret = tmp_path / "source", tmp_path / "secret"
    secret.write_bytes(b"secret")
    if kind == "link":
        source.symlink_to(secret)
    elif kind == "second name":
        os.link(secret, source)
    elif kind == "pipe":
        os.mkfifo(source)
    elif kind == "folder":
        source.mkdir()
    elif kind == "large":
        source.write_bytes(b"x" * 101)
    ended = Ended("exited", 0, None, tmp_path, 0.0, 0, "", lives=True)
    with pytest.raises(NotAdopted):
        adopt_outputs([MadeFile("a.png", "source", "", "image/png")], ended, tmp_path / "frame", 100, "c1")
    assert secret.read_bytes() == b"secret"
    assert not (tmp_path / "frame" / "output-0-c1").exists()


def test_what_there_was_under_the_name_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "source").write_bytes(b"new")
    (tmp_path / "target").write_bytes(b"older")
    assert adopt_copy(tmp_path / "source", tmp_path / "target", 3) == 3
    assert (tmp_path / "target").read_bytes() == b"new"
