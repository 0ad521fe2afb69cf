"""What an object store does for the service, in memory, in a folder, and over HTTP from a server that speaks S3."""

from __future__ import annotations

import uuid
from pathlib import Path

import pytest
from tests.service.s3 import object_store_packages, s3_bucket, s3_server

from primray.errors import SettingsError
from primray_service.config import ServeConfig
from primray_service.files import DataDirectory
from primray_service.objects import Objects, opened

__all__ = ["object_store_packages", "s3_bucket", "s3_server"]


@pytest.fixture(params=["memory", "file", "s3"])
def objects(request: pytest.FixtureRequest, object_store_packages: None, tmp_path: Path) -> Objects:
    if request.param == "s3":
        return opened(f"{request.getfixturevalue('s3_bucket')}/{uuid.uuid4().hex}")
    return opened({"memory": f"memory://{uuid.uuid4().hex}", "file": f"file://{tmp_path}/store"}[request.param])


def test_files_go_in_and_come_out(objects: Objects, tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "below" / "there"
    here.write_bytes(bytes(range(256)) * 5000)
    objects.put(here, "scenes/ab/upload")
    objects.get("scenes/ab/upload", there)
    assert there.read_bytes() == here.read_bytes()
    assert objects.size("scenes/ab/upload") == 1_280_000
    assert objects.read("scenes/ab/upload", 255, 258) == bytes([255, 0, 1])
    assert objects.has("scenes/ab/upload")
    assert objects.folders("scenes") == ["ab"]
    objects.remove("scenes/ab/upload")
    assert not objects.has("scenes/ab/upload")
    objects.remove("scenes/ab/upload")
    assert objects.folders("nowhere") == []
    with pytest.raises(FileNotFoundError):
        objects.size("scenes/ab/upload")
    with pytest.raises(FileNotFoundError):
        objects.get("scenes/ab/upload", there)
    assert there.read_bytes() == here.read_bytes()  # nothing half
    assert [path.name for path in there.parent.iterdir()] == ["there"]


def test_what_changes_is_brought_again_and_else_not(objects: Objects, tmp_path: Path) -> None:
    copy = tmp_path / "log.txt"
    objects.get_newest("log.txt", copy)
    assert not copy.exists()
    for content in (b"one", b"one, two", b"three"):
        objects.write("log.txt", content)
        objects.get_newest("log.txt", copy)
        assert copy.read_bytes() == content
    before = copy.stat().st_ino
    objects.get_newest("log.txt", copy)
    assert copy.stat().st_ino == before
    objects.remove("log.txt")
    objects.get_newest("log.txt", copy)
    assert not copy.exists()


def test_what_lies_below_goes_but_for_what_is_kept(objects: Objects) -> None:
    for name in ("jobs/a/frames/0/log.txt", "jobs/a/frames/0/checkpoint-1", "jobs/a/outputs/x", "jobs/ab/outputs/y"):
        objects.write(name, b"here")
    objects.remove_below("jobs/a/frames/0", ["jobs/a/frames/0/log.txt"])
    assert objects.has("jobs/a/frames/0/log.txt")
    assert not objects.has("jobs/a/frames/0/checkpoint-1")
    objects.remove_below("jobs/a")
    objects.remove_below("jobs/a")
    assert not objects.has("jobs/a/outputs/x")
    assert objects.has("jobs/ab/outputs/y")


def test_a_folder_has_what_was_shared_and_is_not_here(objects: Objects, tmp_path: Path) -> None:
    one, other = (DataDirectory(tmp_path / name, objects) for name in ("one", "other"))
    path = one.job("job_1") / "frames" / "0" / "checkpoint-1.prc"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"samples")
    one.share(path)
    there = other.job("job_1") / "frames" / "0" / "checkpoint-1.prc"
    assert other.has(there)
    assert other.bring(there)
    assert there.read_bytes() == b"samples"
    other.remove(there)
    assert not other.has(there)
    assert not other.bring(there)
    one.share(path)
    one.remove_job("job_1")
    assert not path.exists()
    assert not other.has(there)


def test_a_store_that_fails_is_an_oserror(s3_bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    import fsspec

    fsspec.filesystem("s3").clear_instance_cache()
    with pytest.raises(OSError, match=r"."):
        opened("s3://nobody/here").has("x")
    fsspec.filesystem("s3").clear_instance_cache()


@pytest.mark.parametrize(("url", "code"), [("nothing://x/y", "objects-url"), ("gs://bucket/x", "objects-missing")])
def test_what_cannot_be_opened_is_said_at_the_start(url: str, code: str, object_store_packages: None) -> None:
    with pytest.raises(SettingsError) as caught:
        opened(url)
    assert caught.value.code == code


def test_servers_that_share_a_store_share_a_database(tmp_path: Path) -> None:
    with pytest.raises(SettingsError) as caught:
        ServeConfig(tmp_path, objects="memory://x")
    assert caught.value.code == "objects-database"
