"""The compiled core for this CPU: the names of the module that `native` chooses, which is loaded at the first use of one.

compiled.pyi, which `make stubs` generates from the module, has their types.
"""

from __future__ import annotations

from .native import module


def __getattr__(name: str) -> object:
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    core = module()
    try:
        return getattr(core, name)  # at each use: tests put other modules in its place
    except AttributeError:
        message = f"the compiled core has no {name!r}: if it is older than these sources, `make setup` compiles it"
        raise AttributeError(message) from None
