"""Shared libraries that commands load while Python imports: those of the modules that follow, and no others."""

import subprocess
import sys
from pathlib import Path

import pytest

from primray.cli.libraries_ahead import MODULES, installed

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="libraries are loaded ahead on Linux")

LOADED = """
import sys
from pathlib import Path
from primray.cli.libraries_ahead import installed, load
load([Path("/nowhere/missing.so"), *installed()])
assert not {"pxr", "OpenImageIO"} & set(sys.modules)
before = set(line.split(maxsplit=5)[-1].strip() for line in open("/proc/self/maps") if ".so" in line)
print([str(file) for file in installed() if str(file.resolve()) not in before])
import OpenImageIO
from pxr import Usd, UsdGeom, UsdLux, UsdShade, UsdUtils
print(Usd.Stage.CreateInMemory().DefinePrim("/a").GetPath())
"""

IMPORTED = """
import sys
import primray, primray.usd, primray.images.image
primray.usd.open_stage
print([m.__file__ for name, m in sys.modules.items() if name.startswith("pxr.") and name.split(".")[-1].startswith("_")])
"""


def _run(code: str) -> list[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()


def test_every_module_is_found_where_it_is_installed():
    assert len(installed()) == len(MODULES)


def test_loaded_libraries_are_those_that_imports_take():
    missing, path = _run(LOADED)
    assert missing == "[]"
    assert path == "/a"


def test_nothing_is_loaded_that_a_translation_does_not_import():
    imported = {Path(file).resolve() for file in eval(_run(IMPORTED)[0])}
    ours = {file.resolve() for file in installed() if "pxr" in file.parts}
    assert ours <= imported
