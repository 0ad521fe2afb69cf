"""Runs the tests in groups beside each other: `make test` those of a change (QUICK), `make test-all` all but the long ones.

    python -m tests.run quick
    python -m tests.run all [ARGUMENTS OF PYTEST ...]

Many tests wait for processes that they start, so more groups than cores keep the cores busy. A line every half minute says
how far each group is; its output is in build/tests/GROUP.log, and is shown where it fails.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT / "build" / "tests"
PERCENT = re.compile(r"\[ *(\d+%)\]")
EVERY_S = 30.0  # between two lines on how far the groups are


@dataclass(frozen=True)
class Group:
    """Tests of one pytest: `paths` without those `left_out`, in one process, or by `workers` that take whole files, whose tests
    share servers, in their order. `nice` is added to its CPU priority number."""

    name: str
    paths: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    workers: int = 0
    nice: int = 0

    def command(self, arguments: list[str]) -> list[str]:
        side_by_side = ["-n", str(self.workers), "--dist", "loadfile", "--no-loadscope-reorder"] if self.workers else []
        ignored = [f"--ignore={path}" for path in self.left_out]
        return [sys.executable, "-m", "pytest", *side_by_side, *ignored, *arguments, *self.paths]


# Servers, their clients and clusters wait for each other, and give up after a time: what computes goes after them, and shares
# the cores evenly with the workers of servers, which are as nice.
COMPUTES = 10
OF_PROCESSES = ("tests/images/notebooks", "tests/images/parts")
UNITS = Group("units", ("tests/unit", "tests/translation", "tests/properties", "tests/docs"), nice=COMPUTES)
PICTURES = Group("pictures", ("tests/kernels", "tests/images"), left_out=OF_PROCESSES, nice=COMPUTES)
CASES = Group("cases", ("tests/hard", "tests/statistics", "tests/reference", "tests/bench", "tests/deploy"), nice=COMPUTES)
# Several clusters at once starve each other: these tests share one.
OF_CLUSTERS = ("tests/service/executor/ray", "tests/service/farm")
CLUSTERS = Group("clusters", OF_CLUSTERS)
PROCESSES = Group(
    "processes", ("tests/contrib", "tests/examples", *OF_PROCESSES, "tests/service"), left_out=OF_CLUSTERS, workers=3
)
QUICK = (UNITS, PICTURES)
ALL = (UNITS, PICTURES, CASES, PROCESSES, CLUSTERS)


class Run:
    """A group's pytest, its output in a file."""

    def __init__(self, group: Group, arguments: list[str]) -> None:
        self.group = group
        self.may_be_empty = bool(arguments)  # which may select tests of other groups
        self.log = LOGS / f"{group.name}.log"
        self.began = time.monotonic()
        self.took_s = 0.0
        with self.log.open("wb") as output:
            self.process = subprocess.Popen(
                group.command(arguments), cwd=ROOT, stdout=output, stderr=subprocess.STDOUT, preexec_fn=self._begin
            )

    def _begin(self) -> None:
        """Run in the group's process before pytest."""
        os.nice(self.group.nice)
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # some tests press Ctrl-C, which a shell lets its background ignore

    def has_ended(self) -> bool:
        if self.process.poll() is None:
            return False
        self.took_s = self.took_s or time.monotonic() - self.began
        return True

    @property
    def has_failed(self) -> bool:
        return self.process.returncode != 0 and not (
            self.may_be_empty and self.process.returncode == pytest.ExitCode.NO_TESTS_COLLECTED
        )

    def text(self) -> str:
        return self.log.read_text(encoding="utf-8", errors="replace")

    def progress(self) -> str:
        """Return how far the group is: "units 35%", or how it ended."""
        if self.has_ended():
            return f"{self.group.name} {'failed' if self.has_failed else 'passed'} ({self.took_s:.0f} s)"
        return f"{self.group.name} {(PERCENT.findall(self.text()) or ['0%'])[-1]}"


def run(groups: tuple[Group, ...], arguments: list[str]) -> int:
    """Run the groups beside each other, show the output of those that fail, and return the exit code."""
    LOGS.mkdir(parents=True, exist_ok=True)
    runs = [Run(group, arguments) for group in groups]
    try:
        shown = time.monotonic()
        while sum(not each.has_ended() for each in runs):
            time.sleep(0.2)
            if time.monotonic() - shown >= EVERY_S:
                shown = time.monotonic()
                print(", ".join(each.progress() for each in runs), flush=True)
    except KeyboardInterrupt:
        for each in runs:
            each.process.send_signal(signal.SIGINT)
        for each in runs:
            each.process.wait()
        return 130
    failed = [each for each in runs if each.has_failed]
    for each in failed:
        print(f"\n{each.group.name}: {' '.join(each.group.paths)}\n{each.text()}")
    for each in runs:
        print(f"{each.progress()}: {(each.text().strip().splitlines() or [''])[-1]}")
    return 1 if failed else 0


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["quick", *given]:
            sys.exit(run(QUICK, given))
        case ["all", *given]:
            sys.exit(run(ALL, given))
    sys.exit(__doc__)
