"""Scenes go into the object store once, come to a node once, whole and nothing else, and go when room is needed."""

from __future__ import annotations

import hashlib
import io
import os
import tarfile
from pathlib import Path

import pytest

from primray_service.executor.ray.driver import contents as sent
from primray_service.executor.ray.driver.contents import Contents
from primray_service.executor.ray.node.cache import NodeCache
from primray_service.executor.ray.node.chunk_task import taken
from primray_service.executor.ray.node.transfer import Content, FileEnd, Part


class Store:
    """As Ray's, by numbers."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.reads = 0

    def put(self, data: bytes) -> int:
        self.parts.append(data)
        return len(self.parts) - 1

    def get(self, ref: int) -> bytes:
        self.reads += 1
        return self.parts[ref]


@pytest.fixture
def store() -> Store:
    return Store()


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "package"
    (folder / "textures").mkdir(parents=True)
    (folder / "shot.usda").write_bytes(b"#usda 1.0\n")
    (folder / "textures" / "wood.png").write_bytes(os.urandom(3000))
    (folder / "empty").write_bytes(b"")
    return folder


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_file_goes_by_its_hash(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sent, "PART_BYTES", 1000)
    data = os.urandom(2500)
    (tmp_path / "upload").write_bytes(data)
    content = Contents(store.put).of_file(tmp_path / "upload", keep=True)
    assert content.sha256 == hashlib.sha256(data).hexdigest()
    assert [len(part) for part in store.parts] == [1000, 1000, 500]
    held = NodeCache(tmp_path / "cache").hold(content, store.get)
    assert held.path.read_bytes() == data


def test_a_folder_comes_as_it_was(store: Store, package: Path, tmp_path: Path) -> None:
    held = NodeCache(tmp_path / "cache").hold(Contents(store.put).of_folder(package), store.get)
    assert files(held.path) == files(package)


def test_the_same_files_go_once(store: Store, package: Path, tmp_path: Path) -> None:
    contents, cache = Contents(store.put), NodeCache(tmp_path / "cache")
    first = contents.of_folder(package)
    assert not cache.hold(first, store.get).was_there
    put, read = len(store.parts), store.reads
    assert contents.of_folder(package) is first
    assert cache.hold(first, store.get).was_there
    assert NodeCache(tmp_path / "cache").hold(first, store.get).was_there  # another process
    assert (len(store.parts), store.reads) == (put, read)
    (package / "shot.usda").write_bytes(b"#usda 1.0\n# changed\n")
    assert contents.of_folder(package).sha256 != first.sha256


def test_what_the_store_has_no_room_for_is_put_again(store: Store, tmp_path: Path) -> None:
    contents = Contents(store.put, kept_bytes=1500)
    for name in ("a", "b", "a"):
        (tmp_path / name).write_bytes(name.encode() * 1000)
        contents.of_file(tmp_path / name, keep=True)
    assert len(store.parts) == 3


def test_a_link_is_not_followed(store: Store, package: Path) -> None:
    (package / "passwd").symlink_to("/etc/passwd")
    with pytest.raises(OSError, match="passwd"):
        Contents(store.put).of_folder(package)


def test_other_bytes_are_refused(store: Store, tmp_path: Path) -> None:
    (tmp_path / "upload").write_bytes(b"right")
    content = Contents(store.put).of_file(tmp_path / "upload", keep=True)
    store.parts[0] = b"wrong"
    cache = NodeCache(tmp_path / "cache")
    with pytest.raises(ValueError, match="changed in transit"):
        cache.hold(content, store.get)
    store.parts[0] = b"right"
    assert cache.hold(content, store.get).path.read_bytes() == b"right"


@pytest.mark.parametrize("name", ["../out", "/out", "link"])
def test_an_archive_stays_in_its_folder(store: Store, tmp_path: Path, name: str) -> None:
    made = io.BytesIO()
    with tarfile.open(fileobj=made, mode="w") as archive:
        member = tarfile.TarInfo(name)
        member.type = tarfile.SYMTYPE if name == "link" else tarfile.REGTYPE
        member.linkname = "/etc/passwd" if name == "link" else ""
        archive.addfile(member, io.BytesIO())
    data = made.getvalue()
    content = Content(hashlib.sha256(data).hexdigest(), len(data), True, True, (store.put(data),))
    with pytest.raises(ValueError, match="not a plain file of a scene"):
        NodeCache(tmp_path / "cache").hold(content, store.get)
    assert not (tmp_path / "out").exists()


def test_the_oldest_goes_but_not_what_is_used(store: Store, tmp_path: Path) -> None:
    contents, cache = Contents(store.put), NodeCache(tmp_path / "cache", kept_bytes=2500)
    made = []
    for number, name in enumerate("abc"):
        (tmp_path / name).write_bytes(name.encode() * 1000)
        made.append(contents.of_file(tmp_path / name, keep=True))
        held = cache.hold(made[-1], store.get)
        os.utime(held.path.with_name(f"{held.path.name}.lock"), (number, number))
        if name != "a":
            held.release()
    there = [(tmp_path / "cache" / content.sha256).exists() for content in made]
    assert there == [True, False, True]


def test_checkpoints_are_not_kept(store: Store, tmp_path: Path) -> None:
    (tmp_path / "checkpoint").write_bytes(b"half a picture")
    held = NodeCache(tmp_path / "cache").hold(Contents(store.put).of_file(tmp_path / "checkpoint", keep=False), store.get)
    assert held.path.read_bytes() == b"half a picture"
    held.release()
    assert not list((tmp_path / "cache").iterdir())


def test_a_workers_file_leaves_in_parts(tmp_path: Path) -> None:
    (tmp_path / "beauty.exr").write_bytes(b"a picture")
    items = list(taken(tmp_path, "beauty.exr", 100))
    assert items == [Part("beauty.exr", b"a picture"), FileEnd("beauty.exr", hashlib.sha256(b"a picture").hexdigest())]
    assert not (tmp_path / "beauty.exr").exists()


@pytest.mark.parametrize("what", ["link", "fifo", "large", "hard link", "missing"])
def test_what_is_no_plain_file_does_not_leave(tmp_path: Path, what: str) -> None:
    path = tmp_path / "beauty.exr"
    match what:
        case "link":
            (tmp_path / "secret").write_bytes(b"x")
            path.symlink_to(tmp_path / "secret")
        case "fifo":
            os.mkfifo(path)
        case "large":
            path.write_bytes(b"x" * 101)
        case "hard link":
            (tmp_path / "other").write_bytes(b"x")
            os.link(tmp_path / "other", path)
    assert not list(taken(tmp_path, "beauty.exr", 100))
