"""Landlock alone, against what the kernel documents (userspace-api/landlock.rst): which calls are refused, and how."""

from __future__ import annotations

import json
import os
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.service.sandbox.inside import make_slot, needs, run_inside

from primray_service.sandbox import landlock


@pytest.fixture(scope="module")
def targets(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, object]]:
    needs("landlock")
    outside = tmp_path_factory.mktemp("outside")
    (outside / "file").write_text("secret")
    with socket.create_server(("127.0.0.1", 0)) as tcp, socket.socket(socket.AF_UNIX) as abstract:
        name = f"\0primray-test-{os.getpid()}"
        abstract.bind(name)
        abstract.listen()
        yield {"folder": str(outside), "port": tcp.getsockname()[1], "abstract": name, "pid": os.getpid()}


PROGRAM = """
targets = json.loads(TARGETS)
outside, job, out = targets["folder"], str(entered.job), str(entered.out)
def connect(family, address):
    with socket.socket(family) as made:
        made.connect(address)
def flags(path, how):
    return attempt(lambda: os.close(os.open(path, how)))
(entered.out / "mine").write_text("x")
(entered.out / "sub").mkdir()
say({
    "read the job": flags(f"{job}/scene", os.O_RDONLY),
    "list the job": attempt(os.listdir, job),
    "write the job": flags(f"{job}/scene", os.O_WRONLY),
    "truncate the job's file": attempt(os.truncate, f"{job}/scene", 0),
    "make a file in the job": flags(f"{job}/new", os.O_WRONLY | os.O_CREAT),
    "remove from the job": attempt(os.unlink, f"{job}/scene"),
    "link job to out": attempt(os.link, f"{job}/scene", f"{out}/linked"),
    "rename job to out": attempt(os.rename, f"{job}/scene", f"{out}/moved"),
    "rename in out": attempt(os.rename, f"{out}/mine", f"{out}/sub/mine"),
    "symbolic link in out": attempt(os.symlink, "/etc", f"{out}/link"),
    "socket in out": attempt(lambda: socket.socket(socket.AF_UNIX).bind(f"{out}/socket")),
    "pipe in out": attempt(os.mkfifo, f"{out}/pipe"),
    "read outside": flags(f"{outside}/file", os.O_RDONLY),
    "list outside": attempt(os.listdir, outside),
    "write outside": flags(f"{outside}/new", os.O_WRONLY | os.O_CREAT),
    "up from the job": flags(f"{job}/../../../outside0/file", os.O_RDONLY),
    "by a descriptor of the root": attempt(lambda: os.open("etc/passwd", os.O_RDONLY, dir_fd=os.open("/", os.O_PATH))),
    "by /proc/self/root": flags("/proc/self/root/etc/passwd", os.O_RDONLY),
    "own environment": flags("/proc/self/environ", os.O_RDONLY),
    "execute": attempt(os.execv, "/bin/true", ["true"]),
    "listen": attempt(lambda: socket.create_server(("127.0.0.1", 0))),
    "connect by TCP": attempt(connect, socket.AF_INET, ("127.0.0.1", targets["port"])),
    "connect to an abstract socket": attempt(connect, socket.AF_UNIX, targets["abstract"]),
    "signal the server": attempt(os.kill, targets["pid"], 0),
    "signal itself": attempt(os.kill, os.getpid(), 0),
    "exists": os.path.exists(f"{outside}/file"),
})
"""


def test_what_is_refused_and_how(targets: dict[str, object], tmp_path: Path) -> None:
    slot = make_slot(tmp_path)
    (slot / "job" / "scene").write_text("scene")
    ended = run_inside(slot, f"TARGETS = {json.dumps(targets)!r}\n{PROGRAM}", needs("landlock"))
    assert ended.said is not None, ended.errors
    version = landlock.abi()
    expected: dict[str, object] = dict.fromkeys(ended.said, "EACCES")
    expected |= dict.fromkeys(("read the job", "list the job", "rename in out", "signal itself"), "done")
    # A link or a rename to another folder that REFER does not allow: "EXDEV", or EACCES where other rights are missing too.
    expected |= {"link job to out": "EXDEV", "exists": True}
    expected["up from the job"] = ended.said["up from the job"]  # the folder may be called otherwise: ENOENT
    if version < 2:
        expected["rename in out"] = "EXDEV"
    if version < 3:
        expected["truncate the job's file"] = "done"
    if version < 4:
        expected |= dict.fromkeys(("listen", "connect by TCP"), "done")
    if version >= 6:
        expected |= dict.fromkeys(("connect to an abstract socket", "signal the server"), "EPERM")
    else:
        expected |= dict.fromkeys(("connect to an abstract socket", "signal the server"), "done")
    assert ended.said == expected
    assert (slot / "job" / "scene").read_text() == "scene"


def test_rights_of_each_version() -> None:
    """Bits that a version does not know make landlock_create_ruleset fail with EINVAL."""
    assert [landlock.handled_fs(version).bit_length() for version in range(1, 8)] == [13, 14, 15, 15, 16, 16, 16]
    assert landlock.handled_fs(99) == landlock.handled_fs(5)


def test_files_that_come_later_can_be_read(tmp_path: Path) -> None:
    """A worker is warm before its job is known: the server links files in afterwards."""
    layers = needs("landlock", "seccomp", "rlimits")
    slot = make_slot(tmp_path)
    (tmp_path / "kept").write_text("the scene")
    program = """
import time
while not os.path.exists(entered.job / "folder" / "scene"):
    time.sleep(0.01)
scene = entered.job / "folder" / "scene"
say({"read": scene.read_text(), "write": attempt(os.open, scene, os.O_RDWR)})
"""

    def later() -> None:
        (slot / "job" / "folder").mkdir()
        os.link(tmp_path / "kept", slot / "job" / "folder" / "scene")

    timer = threading.Timer(0.3, later)
    timer.start()
    ended = run_inside(slot, program, layers)
    timer.join()
    assert ended.said == {"read": "the scene", "write": "EACCES"}


def test_threads_that_run_already_are_an_error(tmp_path: Path) -> None:
    """They would stay outside."""
    preface = "import threading, time\nthreading.Thread(target=time.sleep, args=(5,), daemon=True).start()\n"
    program = "from primray_service.sandbox import enter\nenter()\n"
    ended = run_inside(make_slot(tmp_path), program, needs("landlock"), preface=preface)
    assert ended.exit_code == 1
    assert "2 threads run already" in ended.errors
