"""Compiles the core and packs it, for the Makefile: one line counts what is compiled, where pip would be silent for minutes.

    python renderer/core/build.py install own     both packages, editable, with the core for this CPU's newest ISA class
    python renderer/core/build.py install v2      with the core for v2 too
    python renderer/core/build.py install all     with one for each class that this CPU runs
    python renderer/core/build.py wheel           a wheel into dist/, with all three
    python renderer/core/build.py debug           a core with assertions, under sanitizers, into build/debug/

What pip and ninja say is in build/pip.log, and shown when they fail.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LOG = ROOT / "build" / "pip.log"
QUIET_S = 10.0  # between lines where no terminal can show one that changes


def isas_of(asked: str) -> list[str]:
    """The ISA classes that `own`, `all` or the name of one mean here."""
    sys.path.insert(0, str(ROOT / "renderer"))
    # The sources as they are, not where the last install found them.
    sys.meta_path[:] = [finder for finder in sys.meta_path if not type(finder).__module__.startswith("_editable")]
    from primray import core

    runnable = core.runnable_isas()
    if asked == "all":
        return runnable
    named = [core.isa()] if asked == "own" else [asked]  # says what is wrong with this CPU, or with PRIMRAY_ISA
    return list(dict.fromkeys([runnable[0], *named]))


def counted(line: str) -> tuple[int, int] | None:
    """What ninja has done, and of how much: "[12/79] Building ..."."""
    found = re.match(r"\s*\[(\d+)/(\d+)\] ", line)
    return (int(found[1]), int(found[2])) if found else None


class Counter:
    """One line that changes on a terminal, and one every few seconds elsewhere."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.began = self.shown = time.monotonic()
        self.is_live = sys.stdout.isatty()
        self._put(f"{what} ...")

    def show(self, done: int, of: int) -> None:
        now = time.monotonic()
        if self.is_live or done == of or now - self.shown >= QUIET_S:
            self.shown = now
            self._put(f"{self.what}: {done} of {of} files, {now - self.began:.0f} s")

    def finish(self) -> None:
        if self.is_live:
            print(flush=True)

    def _put(self, text: str) -> None:
        print(f"\r{text}" if self.is_live else text, end="" if self.is_live else "\n", flush=True)


def pip(what: str, *arguments: str) -> int:
    """Run pip and return its exit code."""
    return logged(what, [sys.executable, "-m", "pip", "--disable-pip-version-check", "--verbose", *arguments])


def debug(isa: str) -> int:
    """Build one ISA class with assertions and sanitizers into build/debug, for PRIMRAY_CORES; return the exit code."""
    folder, tools = ROOT / "build" / "debug", Path(sys.executable).parent
    nanobind = subprocess.run([sys.executable, "-m", "nanobind", "--cmake_dir"], capture_output=True, text=True, check=True)
    configure = [f"{tools / 'cmake'}", "-G", "Ninja", "-S", f"{ROOT / 'renderer' / 'core'}", "-B", f"{folder}"]
    configure += [f"-DPRIMRAY_ISAS={isa}", "-DPRIMRAY_DEBUG=ON", f"-Dnanobind_DIR={nanobind.stdout.strip()}"]
    configure += [f"-DPython_EXECUTABLE={sys.executable}", f"-DCMAKE_MAKE_PROGRAM={tools / 'ninja'}"]
    what = f"compiling the core with assertions ({isa})"
    return logged(what, configure) or logged(what, [f"{tools / 'ninja'}", "-C", f"{folder}"])


def logged(what: str, command: list[str]) -> int:
    """Run a command that compiles and return its exit code; one line counts the files, and its output is shown if it fails."""
    LOG.parent.mkdir(exist_ok=True)
    counter = Counter(what)
    with (
        LOG.open("w", encoding="utf-8") as log,
        subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
        ) as run,
    ):
        assert run.stdout is not None
        for line in run.stdout:
            log.write(line)
            if count := counted(line):
                counter.show(*count)
    counter.finish()
    if run.returncode:
        print(f"{LOG.read_text(encoding='utf-8')}\n{what}: failed; the lines above are in {LOG}", file=sys.stderr)
    return run.returncode


def main(arguments: list[str]) -> int:
    building = ("--no-deps", "--no-build-isolation")
    match arguments:
        case ["install", asked]:
            isas = isas_of(asked)
            chosen = f"--config-settings=cmake.define.PRIMRAY_ISAS={';'.join(isas)}"
            return pip(
                f"compiling the core ({', '.join(isas)})", "install", "--no-compile", *building, chosen, "--editable", "."
            )
        case ["wheel"]:
            return pip("compiling the core for a wheel", "wheel", *building, "--wheel-dir", "dist", ".")
        case ["debug"]:
            return debug("v3")
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
