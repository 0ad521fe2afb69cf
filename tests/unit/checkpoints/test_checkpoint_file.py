"""The container of checkpoints: written whole or not at all, and nothing that is not whole is taken for one."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from primray.checkpoints.checkpoint_file import read_checkpoint, read_header, write_checkpoint
from primray.errors import CheckpointError, PrimrayError

ARRAYS = {
    "a": np.arange(24, dtype="<i8").reshape(2, 3, 4),
    "b": np.array([-4, 3], "i1"),
    "none": np.zeros((2, 0), "<f8"),
    "one": np.array([1.5]),
    "big": np.arange(5, dtype=">u4"),
}
HEADER = {"name": "é", "number": 0.1, "list": [1, None]}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_checkpoint(tmp_path / "a.prc", HEADER, ARRAYS)
    return tmp_path / "a.prc"


def code_of(path: Path) -> str:
    with pytest.raises(CheckpointError) as caught:
        read_checkpoint(path)
    assert caught.value.where == str(path)
    assert caught.value.exit_code == 2
    return caught.value.code


def test_what_was_written_is_read(file: Path) -> None:
    header, arrays = read_checkpoint(file)
    assert {name: header[name] for name in HEADER} == HEADER
    assert read_header(file) == header
    assert list(arrays) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert arrays[name].shape == array.shape
        np.testing.assert_array_equal(arrays[name], array)
    assert os.listdir(file.parent) == ["a.prc"]


def test_every_truncation_is_damage(file: Path) -> None:
    whole = file.read_bytes()
    for length in [*range(40), *range(40, len(whole), 3), len(whole) - 1]:
        file.write_bytes(whole[:length])
        assert code_of(file) == "checkpoint-damaged", length
    file.write_bytes(whole + b"\0")
    assert code_of(file) == "checkpoint-damaged"


def test_every_flipped_byte_is_noticed(file: Path) -> None:
    whole = bytearray(file.read_bytes())
    for at in [*range(40), *range(40, len(whole), 3)]:
        whole[at] ^= 0x10
        file.write_bytes(whole)
        # The digit of the format becomes none, or that of another format.
        assert code_of(file) in ("checkpoint-damaged", "checkpoint-format"), at
        whole[at] ^= 0x10


def test_other_formats_are_named(file: Path) -> None:
    file.write_bytes(file.read_bytes().replace(b"checkpoint 3\n", b"checkpoint 23\n", 1))
    with pytest.raises(CheckpointError, match="has format 23, and this version of primray reads 3") as caught:
        read_header(file)
    assert caught.value.code == "checkpoint-format"


def test_what_is_no_file(tmp_path: Path) -> None:
    assert code_of(tmp_path / "missing.prc") == "checkpoint-missing"
    assert code_of(tmp_path) == "checkpoint-missing"
    os.mkfifo(tmp_path / "pipe")
    assert code_of(tmp_path / "pipe") == "checkpoint-missing"  # without waiting for a writer


def hostile(header: bytes, length: int | None = None, body: bytes = b"") -> bytes:
    head = b"primray checkpoint 3\n" + struct.pack("<Q", len(header) if length is None else length) + header
    return head + hashlib.sha256(head).digest() + body + hashlib.sha256(body).digest()


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"[]",
        b"null",
        b"{}",
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"arrays": 5}',
        b'{"arrays": [5]}',
        b'{"arrays": [["a", "<i8"]]}',
        *(
            json.dumps({"arrays": [["a", kind, shape]]}).encode()
            for kind, shape in [
                ("<i8", [2**39, 2**39]),
                ("<i8", [2**62, 4]),
                ("<i8", [10**30]),
                ("<i8", [2**39] * 1000),
                ("<i8", [-1]),
                ("<i8", [-1, -8]),
                ("<i8", [1.0]),
                ("<i8", [True]),
                ("<i8", ["8"]),
                ("<i8", 8),
                ("|O", [1]),
                ("V99999999999", [1]),
                ("<U1000000000", [1]),
                ([], [1]),
            ]
        ),
    ],
)
def test_headers_that_lie_allocate_nothing(tmp_path: Path, text: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    def empty(*of: Any) -> Any:
        made.append(of)
        return np.zeros(*of)

    monkeypatch.setattr(np, "empty", empty)
    path = tmp_path / "a.prc"
    path.write_bytes(hostile(text, body=b"12345678"))
    assert code_of(path) == "checkpoint-damaged"
    assert made == []


@pytest.mark.parametrize("length", [2**63, 2**64 - 1, 2**40, 1000])
def test_lengths_that_lie_read_nothing(tmp_path: Path, length: int) -> None:
    path = tmp_path / "a.prc"
    path.write_bytes(hostile(b"{}", length))
    assert code_of(path) == "checkpoint-damaged"


def test_a_write_that_fails_leaves_the_older_one(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = file.read_bytes()

    def full(number: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(PrimrayError, match="No space left"):
        write_checkpoint(file, HEADER, {"a": np.zeros(100, "<i8")})
    assert file.read_bytes() == before
    assert os.listdir(file.parent) == ["a.prc"]


def test_the_disk_has_it_before_it_takes_the_place(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    fsync, replace = os.fsync, os.replace

    def synced(number: int) -> None:
        done.append("sync file" if os.path.isfile(f"/proc/self/fd/{number}") else "sync folder")
        fsync(number)

    def replaced(a: Any, b: Any) -> None:
        done.append("replace")
        replace(a, b)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    write_checkpoint(file, HEADER, ARRAYS)
    assert done == ["sync file", "replace", "sync folder"]


def test_what_a_killed_writer_left_is_taken_over(file: Path) -> None:
    (file.parent / ".a.prc.partial").write_bytes(b"x" * 10_000)
    write_checkpoint(file, HEADER, ARRAYS)
    read_checkpoint(file)
    assert os.listdir(file.parent) == ["a.prc"]


def test_two_writers_are_told(file: Path) -> None:
    before = file.read_bytes()
    with open(file.parent / ".a.prc.partial", "wb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(PrimrayError, match="another process"):
            write_checkpoint(file, HEADER, ARRAYS)
    assert file.read_bytes() == before


WRITER = """
import sys, numpy as np
from pathlib import Path
from primray.checkpoints.checkpoint_file import write_checkpoint
for n in range(1, 10**9):
    write_checkpoint(Path(sys.argv[1]), {"n": n}, {"a": np.full(300_000, n, "<i8")})
    if n == 1:
        print("begun", flush=True)
"""


def test_kill_at_any_moment_leaves_a_whole_one(tmp_path: Path) -> None:
    path = tmp_path / "a.prc"
    last, wait_s = 0, 0.013
    while last < 2 and wait_s < 60:  # on a busy machine it takes longer until another is written
        process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()
        try:
            process.wait(wait_s)
        except subprocess.TimeoutExpired:
            process.kill()
        process.wait()
        header, arrays = read_checkpoint(path)
        assert (arrays["a"] == header["n"]).all()
        last, wait_s = header["n"], 2 * wait_s
    assert last > 1
