"""Writes the types of the compiled core, renderer/primray/core/compiled.pyi, from the module of this CPU's class.

    python renderer/core/stubs.py

nanobind's generator reads the module; its output is reduced to what type checkers use, and is the same for every ISA class.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from nanobind.stubgen import StubGen

from primray.core.native import module

ROOT = Path(__file__).resolve().parents[2]
STUB = ROOT / "renderer/primray/core/compiled.pyi"
HEADER = '''"""Types of the compiled core; generated from it by `make stubs`."""

'''
# Text of nanobind's stub, and what stands for it.
REPLACED = (
    # Arrays that functions take are copied where they have another type or order: only the type says something.
    (r"Annotated\[(NDArray\[numpy\.\w+\]), dict\(order='C', device='cpu', writable=False\)\]", r"\1"),
    (r"dict\(shape=(\([^)]*\))\)", r'{"shape": \1}'),
    (r"\bNDArray\b(?![\[,\n])", "NDArray[Any]"),
    # The functions of `testing` are for tests, which check them by calling them.
    (r"from primray\.\w+ import testing as testing", "testing: ModuleType"),
    (r"^(ISA|MAX_LANES): (\w+) = .*$", r"\1: \2"),
    (r'\A""".*?"""\n', ""),
)


def stub() -> str:
    """Return the text of the stub."""
    generator = StubGen(module())
    generator.put(module())
    text = generator.get()
    for pattern, by in REPLACED:
        text = re.sub(pattern, by, text, flags=re.MULTILINE)
    text = f"{HEADER}from types import ModuleType\nfrom typing import Any\n{text}"
    for command in (["check", "--fix", "--select", "F401,I", "--exit-zero"], ["format"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--quiet", "--stdin-filename", str(STUB), "-"]
        text = subprocess.run(ruff, input=text, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    return text


if __name__ == "__main__":
    STUB.write_text(stub(), encoding="utf-8")
    print(f"{STUB.relative_to(ROOT)} is written")
