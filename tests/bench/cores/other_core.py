"""A build of the core in place of the installed one. A folder on PYTHONPATH does not do: editable installs come before it."""

from __future__ import annotations

import sys
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from primray import core


def use_core(path: Path) -> None:
    """Before the first use of the core: that file in place of the installed module."""
    name = f"primray._core_{core.isa()}"
    spec = spec_from_file_location(name, path, loader=ExtensionFileLoader(name, str(path)))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    assert core.module().__file__ == str(path)
