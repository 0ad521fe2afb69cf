"""The types of the compiled core are those of the module, which is loaded at the first use of one of its names."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from primray.core import compiled
from primray.core.native import module

GENERATOR = Path(__file__).resolve().parents[3] / "renderer/core/stubs.py"


def test_the_stub_is_what_the_module_says() -> None:
    spec = spec_from_file_location("stubs", GENERATOR)
    assert spec is not None
    assert spec.loader is not None
    stubs = module_from_spec(spec)
    spec.loader.exec_module(stubs)
    assert stubs.STUB.read_text(encoding="utf-8") == stubs.stub(), "run `make stubs`"


def test_names_are_those_of_the_module_in_use() -> None:
    assert compiled.SceneBuilder is module().SceneBuilder
    with pytest.raises(AttributeError, match="make setup"):
        compiled.no_such_name  # type: ignore[attr-defined]  # noqa: B018
    assert not hasattr(compiled, "__path__")


def test_the_module_is_loaded_at_the_first_use() -> None:
    code = (
        "import sys; from primray.core import compiled, passes; "
        "is_loaded = lambda: any(name.startswith('primray._core_') for name in sys.modules); "
        "assert not is_loaded(); compiled.TILE; assert is_loaded()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
