"""The filter: its numbers against the kernel's headers, its program by an interpreter, and in the kernel itself."""

from __future__ import annotations

import os
import re
import signal
from pathlib import Path

import pytest
from tests.service.sandbox.inside import make_slot, needs, run_inside

from primray_service.sandbox import seccomp
from primray_service.sandbox.system_calls import BY_ARGUMENT, LAST_KNOWN, OURS, REFUSED

HEADERS = ("/usr/include/x86_64-linux-gnu/asm/unistd_64.h", "/usr/include/asm-generic/unistd.h")
PID = 4711
ARCHITECTURES = ((0, 0xC000003E), (1, 0xC00000B7))


@pytest.mark.parametrize("place", [0, 1], ids=["x86_64", "aarch64"])
def test_numbers_are_the_kernel_s(place: int) -> None:
    header = Path(HEADERS[place])
    if not header.exists():
        pytest.skip("skipped: no kernel headers")
    found = {n: int(v) for n, v in re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)\n", header.read_text())}
    newest = max(found.values())
    for name, numbers in {**REFUSED, **BY_ARGUMENT, **OURS}.items():
        number = numbers[place]
        if number is None:
            assert name not in found
        elif number <= newest:
            assert found.get(name) == number, name


def decide(program: list[seccomp._Instruction], number: int, arguments: tuple[int, ...] = (), architecture: int = 0) -> int:
    """What the kernel would: classic BPF over struct seccomp_data."""
    words = {0: number, 4: architecture}
    for place, argument in enumerate((*arguments, 0, 0, 0, 0, 0, 0)[:6]):
        words |= {16 + 8 * place: argument & 0xFFFFFFFF, 20 + 8 * place: argument >> 32 & 0xFFFFFFFF}
    at = value = 0
    while True:
        step = program[at]
        match step.code:
            case 0x20:
                value = words[step.value]
            case 0x06:
                return step.value
            case 0x15 | 0x25 | 0x45:
                holds = {0x15: value == step.value, 0x25: value > step.value, 0x45: bool(value & step.value)}[step.code]
                at += step.if_true if holds else step.if_false
            case _:
                raise AssertionError(hex(step.code))
        at += 1


@pytest.mark.parametrize(("place", "architecture"), ARCHITECTURES, ids=["x86_64", "aarch64"])
def test_decisions(place: int, architecture: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.sandbox.seccomp.machine", lambda: place)
    monkeypatch.setattr("primray_service.sandbox.seccomp.number_of", lambda numbers: numbers[place])
    program = seccomp.program(PID)
    assert len(program) < 4096  # BPF_MAXINSNS
    refused = {numbers[place] for numbers in REFUSED.values()} - {None}
    special = {numbers[place] for numbers in BY_ARGUMENT.values()} - {None}
    for number in range(LAST_KNOWN + 1):
        if number not in special:
            expected = seccomp.EPERM if number in refused else seccomp.ALLOW
            assert decide(program, number, architecture=architecture) == expected, number
    for number in (LAST_KNOWN + 1, 0x40000000 | 59, 0xFFFFFFFF):  # the second: execve of x32
        assert decide(program, number, architecture=architecture) == seccomp.ENOSYS
    for other in (0x40000003, 0xC000003E ^ 1, 0x40000028):
        assert decide(program, 1, architecture=other) == seccomp.KILL_PROCESS

    def of(name: str, *arguments: int) -> int:
        number = BY_ARGUMENT[name][place]
        assert number is not None
        return decide(program, number, arguments, architecture)

    thread, fork = 0x3D0F00, 0x1200011
    assert (of("clone", thread), of("clone", fork), of("clone", 0)) == (seccomp.ALLOW, seccomp.EPERM, seccomp.EPERM)
    for namespace in (0x00020000, 0x02000000, 0x04000000, 0x08000000, 0x10000000, 0x20000000, 0x40000000):
        assert of("clone", thread | namespace) == seccomp.EPERM
    assert of("clone3") == seccomp.ENOSYS
    for name in ("kill", "tgkill", "rt_sigqueueinfo", "rt_tgsigqueueinfo"):
        assert [of(name, pid) for pid in (PID, 1, 0, 0xFFFFFFFF)] == [seccomp.ALLOW, *[seccomp.EPERM] * 3]
    for name in ("prlimit64", "sched_setaffinity"):
        assert [of(name, pid) for pid in (PID, 0, 1)] == [seccomp.ALLOW, seccomp.ALLOW, seccomp.EPERM]
    assert [of("ioctl", 1, request) for request in (0x5401, 0x5412, 0x541C)] == [seccomp.ALLOW, seccomp.EPERM, seccomp.EPERM]
    assert [of("prctl", option) for option in (15, 1)] == [seccomp.ALLOW, seccomp.EPERM]


def test_the_kernel_agrees(tmp_path: Path) -> None:
    """Every refused call, made with arguments that mean nothing, gets EPERM before it gets any other error."""
    place = ("x86_64", "aarch64").index(os.uname().machine)
    numbers = {name: number[place] for name, number in REFUSED.items() if number[place] is not None}
    program = f"say({{name: raw(number, 0, 0, 0, 0, 0, 0) for name, number in {numbers!r}.items()}} | {{'new': raw(9999)}})"
    ended = run_inside(make_slot(tmp_path), program, needs("seccomp"))
    assert ended.said == {**dict.fromkeys(numbers, "EPERM"), "new": "ENOSYS"}


def test_threads_start_and_programs_do_not(tmp_path: Path) -> None:
    program = """
import subprocess, threading
said = []
threads = [threading.Thread(target=said.append, args=(n,)) for n in range(20)]
[t.start() for t in threads]
[t.join() for t in threads]
say({"threads": len(said), "fork": attempt(os.fork), "program": attempt(subprocess.run, [sys.executable, "-c", "pass"]),
     "itself": attempt(os.kill, os.getpid(), 0), "server": attempt(os.kill, 1, 0)})
"""
    ended = run_inside(make_slot(tmp_path), program, needs("seccomp"))
    assert ended.said == {"threads": 20, "fork": "EPERM", "program": "EPERM", "itself": "done", "server": "EPERM"}


@pytest.mark.skipif(os.uname().machine != "x86_64", reason="skipped: not x86_64")
@pytest.mark.parametrize("wrapped", [False, True], ids=["plain", "bubblewrap"])
def test_calls_of_another_architecture_kill(tmp_path: Path, wrapped: bool) -> None:
    """int 0x80 enters the kernel as a 32-bit program does, whose calls have other numbers."""
    program = """
import mmap
code = mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
code.write(bytes([0xB8, 20, 0, 0, 0, 0xCD, 0x80, 0xC3]))  # mov eax, 20 (getpid); int 0x80; ret
ctypes.CFUNCTYPE(ctypes.c_int)(ctypes.addressof(ctypes.c_char.from_buffer(code)))()
say("came back")
"""
    layers = needs("seccomp", "bubblewrap") if wrapped else needs("seccomp")
    ended = run_inside(make_slot(tmp_path), program, layers)
    assert (ended.said, ended.signal) == (None, signal.SIGSYS)
