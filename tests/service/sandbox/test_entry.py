"""What a worker starts with: nothing inherited; limits that hold; deaths that are told apart; none outlives its server."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from tests.service.sandbox import inside
from tests.service.sandbox.inside import make_slot, needs, run_inside

from primray_service.sandbox import Budget, worker_pid, worker_spawn

MiB = 2**20
WAYS = [("rlimits", "landlock", "seccomp"), ("rlimits", "landlock", "seccomp", "bubblewrap")]
BOTH = pytest.mark.parametrize("walls", WAYS, ids=["plain", "bubblewrap"])


@BOTH
def test_nothing_is_inherited(walls: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layers = needs(*walls)
    for name in ("PXR_PLUGINPATH_NAME", "PXR_AR_DEFAULT_SEARCH_PATH", "OCIO", "PYTHONPATH", "PYTHONSTARTUP", "API_TOKEN"):
        monkeypatch.setenv(name, "leaked")
    monkeypatch.setenv("PRIMRAY_ISA", "v3")  # but for this: a worker's bits are those of the server's class of CPUs
    secret = os.open(tmp_path / "secret", os.O_RDWR | os.O_CREAT)
    program = """
def opened(n):
    try:
        return bool(os.fstat(n))
    except OSError:
        return False
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
say({
    "environment": sorted(os.environ), "leaked": [k for k, v in os.environ.items() if "leaked" in v],
    "files": [n for n in range(3, 64) if opened(n)], "folder": os.getcwd() == str(entered.out),
    "home": os.environ["HOME"] == os.environ["TMPDIR"] == str(entered.out / "tmp"), "isolated": sys.flags.isolated,
    "path": [p for p in sys.path if not os.path.isabs(p)],
    "capabilities": [status[name].strip() for name in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb")],
    "no_new_privs": status["NoNewPrivs"].strip(), "leader": os.getsid(0) in (os.getpid(), 0, 1, os.getppid()),
})
"""
    ended = run_inside(make_slot(tmp_path), program, layers, pass_fds=(secret,))
    os.close(secret)
    assert ended.said is not None, ended.errors
    none = "0" * 16
    started = [] if inside.FORKS else ["PXR_WORK_THREAD_LIMIT", "TF_ENV_SETTING_ALERTS_ENABLED"]
    wrapped = ["PWD"] if "bubblewrap" in walls and not inside.FORKS else []
    assert ended.said == {
        "environment": [
            *("HOME", "LANG", "LC_ALL", "OPENBLAS_NUM_THREADS", "PRIMRAY_ISA"),
            *wrapped,
            *started,
            "TMPDIR",
        ],
        "leaked": [],
        "files": [],
        "folder": True,
        "home": True,
        "isolated": 1,
        "path": [],
        "capabilities": [none] * 5,
        "no_new_privs": "1",
        "leader": True,
    }


def test_without_a_plan_nothing_is_entered(tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", "from primray_service.sandbox import enter; enter()"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 1
    assert "workers must be started by the service" in ended.stderr


def test_a_wall_that_cannot_be_raised_ends_the_worker(tmp_path: Path) -> None:
    """Nothing runs with fewer walls than the server believes."""
    preface = (
        "from primray_service.sandbox import landlock\ndef no(*a): raise OSError(95, 'not here')\nlandlock.restrict = no\n"
    )
    program = "from primray_service.sandbox import enter\nenter()\nprint('\"inside\"')"
    ended = run_inside(make_slot(tmp_path), program, needs("landlock"), preface=preface)
    assert (ended.said, ended.exit_code) == (None, 1)
    assert "the sandbox cannot be entered" in ended.errors


@BOTH
def test_limits_hold(walls: tuple[str, ...], tmp_path: Path) -> None:
    program = """
def allocate():
    try:
        return len(bytearray(2800 * 2**20))
    except MemoryError:
        return "MemoryError"
def write():
    with open(entered.out / "large", "wb", buffering=0) as file:
        while True:
            file.write(bytes(2**20))
def open_many():
    held = []
    while True:
        held.append(os.open("/dev/null", os.O_RDONLY))
import resource
say({"memory": allocate(), "file": attempt(write), "size": os.path.getsize(entered.out / "large"), "files": attempt(open_many),
     "core": resource.getrlimit(resource.RLIMIT_CORE)})
"""
    budget = Budget(256 * MiB, threads=1, file_bytes=3 * MiB)
    ended = run_inside(make_slot(tmp_path), program, needs(*walls), budget=budget)
    assert ended.said == {
        "memory": "MemoryError",
        "file": "EFBIG",
        "size": 3 * MiB,
        "files": "EMFILE",
        "core": [0, 0],
    }, ended.errors


def test_limits_cannot_be_raised_again(tmp_path: Path) -> None:
    """Not even by root, who has lost what it needs for that."""
    program = """
import resource
try:
    resource.setrlimit(resource.RLIMIT_AS, (2**40, 2**40))
except (ValueError, OSError) as error:
    say(type(error).__name__)
else:
    say("raised")
"""
    assert run_inside(make_slot(tmp_path), program, needs("rlimits")).said in ("ValueError", "PermissionError")


@BOTH
@pytest.mark.parametrize(
    ("death", "expected"),
    [
        ("limit_cpu(0.1)\nwhile True: pass", signal.SIGXCPU),
        ("os.abort()", signal.SIGABRT),
        ("ctypes.string_at(0)", signal.SIGSEGV),
        ("os.kill(os.getpid(), 9)", signal.SIGKILL),
    ],
    ids=["cpu", "abort", "segfault", "kill"],
)
def test_deaths_are_told_apart(walls: tuple[str, ...], death: str, expected: int, tmp_path: Path) -> None:
    program = f"from primray_service.sandbox import limit_cpu\n{death}"
    ended = run_inside(make_slot(tmp_path), program, needs(*walls))
    assert (ended.exit_code, ended.signal) == (None, expected)


def test_a_phase_has_cpu_seconds_of_its_own(tmp_path: Path) -> None:
    program = """
import resource, time
from primray_service.sandbox import end_phase, limit_cpu_of_phase
before = resource.getrlimit(resource.RLIMIT_CPU)
limit_cpu_of_phase(5)
during = resource.getrlimit(resource.RLIMIT_CPU)
end_phase()
say([before, during, resource.getrlimit(resource.RLIMIT_CPU)])
"""
    before, during, after = run_inside(make_slot(tmp_path), program, needs("rlimits")).said
    assert before == after
    assert 5 <= during[0] <= 8
    assert during[1] == before[1]


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@BOTH
def test_workers_die_with_their_server(walls: tuple[str, ...], tmp_path: Path) -> None:
    """kill -9 of the server: its workers are gone, whatever they were doing."""
    layers = needs(*walls)
    slot = make_slot(tmp_path)
    server = f"""
        import subprocess, time
        from pathlib import Path
        from primray_service.sandbox import Budget, worker_spawn, worker_pid
        inside = "from primray_service.sandbox import enter; enter(); open('inside', 'w').close()\\nwhile True: pass"
        spawn = worker_spawn(Path({str(slot)!r}), Budget(2**30), ("-c", inside), frozenset({sorted(layers)!r}))
        child = subprocess.Popen(spawn.argv, env=spawn.env, cwd=spawn.cwd, start_new_session=True)
        while not (Path({str(slot)!r}) / "out" / "inside").exists():
            time.sleep(0.01)
        print(worker_pid(child.pid), flush=True)
        time.sleep(60)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(server)], stdout=subprocess.PIPE)
    assert process.stdout is not None
    worker = int(process.stdout.readline())
    assert is_alive(worker)
    process.kill()
    process.wait()
    process.stdout.close()
    deadline = time.monotonic() + 10
    while is_alive(worker) and time.monotonic() < deadline:
        time.sleep(0.02)
    lives = is_alive(worker)
    if lives:
        os.kill(worker, signal.SIGKILL)
    assert not lives


def test_the_worker_s_own_process_is_found(tmp_path: Path) -> None:
    """Its memory is what the watchdog must look at, not bubblewrap's."""
    for number, walls in enumerate(WAYS):
        slot = make_slot(tmp_path / str(number))
        spawn = worker_spawn(
            slot, Budget(2**30), ("-c", "from primray_service.sandbox import enter; enter(); input()"), needs(*walls)
        )
        child = subprocess.Popen(spawn.argv, env=spawn.env, cwd=spawn.cwd, stdin=subprocess.PIPE, start_new_session=True)
        assert child.stdin is not None
        try:
            deadline = time.monotonic() + 20
            while not (slot / "out" / "tmp").exists() and time.monotonic() < deadline:
                time.sleep(0.01)
            pid = worker_pid(child.pid)
            assert pid is not None
            assert "bwrap" not in Path(f"/proc/{pid}/comm").read_text()
            assert (pid == child.pid) is not spawn.wrapped
        finally:
            child.stdin.close()
            child.wait(30)


@BOTH
def test_the_servers_colours_can_be_read_and_no_more_of_their_folder(
    walls: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    layers, house = needs(*walls), tmp_path / "house"
    (house / "luts").mkdir(parents=True)
    lut = "Version 1\nFrom 0.0 1.0\nLength 2\nComponents 1\n{\n0.0\n1.0\n}\n"
    for place in ("luts/graded.spi1d", "beside.spi1d"):
        (house / place).write_text(lut)
    (house / "secret.txt").write_text("secret")
    views = "\n".join(f"    - !<View> {{name: {name}, colorspace: {name}}}" for name in ("graded", "beside"))
    spaces = "\n".join(
        f"  - !<ColorSpace> {{name: {name}, from_scene_reference: !<FileTransform> {{src: {name}.spi1d}}}}"
        for name in ("graded", "beside")
    )
    (house / "config.ocio").write_text(
        f"ocio_profile_version: 2\nsearch_path: [luts, .]\nroles: {{default: lin_rec709}}\n"
        f"displays:\n  wall:\n{views}\nactive_displays: []\nactive_views: []\n"
        f"colorspaces:\n  - !<ColorSpace> {{name: lin_rec709}}\n{spaces}\n"
    )
    monkeypatch.setenv("OCIO", str(house / "config.ocio"))
    program = """
from primray.color.ocio import failing_views, views
from pathlib import Path
say({"views": views(), "failing": failing_views(), "secret": attempt(lambda: open(sys.argv[1]).read())})
"""
    program = program.replace("sys.argv[1]", repr(str(house / "secret.txt")))
    ended = run_inside(make_slot(tmp_path), program, layers)
    assert ended.said is not None, ended.errors
    assert ended.said["views"] == ["graded", "beside"]
    assert ended.said["failing"] == []
    assert ended.said["secret"] in ("EACCES", "ENOENT")
