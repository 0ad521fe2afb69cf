"""The compiled core for this CPU: the names of the module that `native` chooses, which is loaded at the first use of one.

compiled.pyi, which `make stubs` generates from the module, has their types.
"""

from __future__ import annotations

from .native import module


def __getattr__(name: str) -> object:
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if not hasattr(module(), name):
        raise AttributeError(f"the compiled core has no {name!r}: if it is older than these sources, `make setup` compiles it")
    found = globals()[name] = getattr(module(), name)  # asked for once
    return found
