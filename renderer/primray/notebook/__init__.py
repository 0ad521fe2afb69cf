"""A view of a stage in a notebook: a picture that refines, is turned with the mouse, and follows edits.

`view` is the widget, `courier` sends its pictures, `stage_lock` keeps cells that edit stages and threads that read them apart,
`script` makes one module of the page's scripts. It needs the extra `notebook`, anywidget, which is imported when it is used.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from ..errors import PrimrayError

if TYPE_CHECKING:
    from .view import View

__all__ = ["View"]


def __getattr__(name: str) -> Any:
    if name != "View":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if find_spec("anywidget") is None:
        sentence = "`primray.notebook` needs the extra `notebook`; install it with: pip install 'primray[notebook]'"
        raise PrimrayError(sentence, where="anywidget", code="extra-missing")
    from .view import View

    return View
