"""What a notebook shows, with an IPython of the test's own; tests/images/test_notebooks.py asks a real kernel."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from primray import Image
from primray.diagnostic_messages import in_notebook
from primray.render import render
from primray.render.progress import shown_progress

if TYPE_CHECKING:
    from tests.unit.conftest import FakePipeline


ROW = {
    "severity": "error",
    "kind": "missing",
    "code": "texture-unreadable",
    "prim_path": "/a",
    "attribute": "",
    "message": "<b>&",
}
INFO = {**ROW, "severity": "info"}


class Shown(list[Any]):
    """What `display` was given, and what its handle was updated with."""

    def display(self, shown: Any, **options: Any) -> Any:
        self.append(shown)
        return SimpleNamespace(update=self.append)


def pretend(monkeypatch: pytest.MonkeyPatch, shell: object) -> Shown:
    shown = Shown()
    for name, content in (("IPython", {"get_ipython": lambda: shell}), ("IPython.display", {"display": shown.display})):
        module = ModuleType(name)
        module.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return shown


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> Shown:
    return pretend(monkeypatch, SimpleNamespace(kernel=1))


def picture(*rows: dict[str, str]) -> Image:
    return Image(np.full((2, 3, 4), 0.5, np.float32), {"diagnostics": list(rows)})


def test_warnings_and_errors_stand_under_the_picture() -> None:
    html = picture(ROW, INFO)._repr_html_()
    assert html is not None
    assert html.index("data:image/png;base64,") < html.index("texture-unreadable")
    assert "&lt;b&gt;&amp;" in html
    assert "<b>" not in html
    assert "info" not in html


def test_a_picture_with_nothing_to_tell_is_a_png() -> None:
    assert picture(INFO)._repr_html_() is None
    assert picture()._repr_png_().startswith(b"\x89PNG")


def test_a_render_in_a_notebook_shows_a_bar_and_takes_it_away(pipeline: FakePipeline, shown: Shown) -> None:
    render("a.usda")
    assert "<progress" in shown[0]._repr_html_()
    assert "50 %" in shown[1]._repr_html_()
    assert shown[-1]._repr_html_() == ""


@pytest.mark.parametrize("progress", [False, lambda *now: None])
def test_no_bar_where_it_is_not_wanted(pipeline: FakePipeline, shown: Shown, progress: Any) -> None:
    render("a.usda", progress=progress)
    assert not shown


def test_the_bar_goes_with_a_render_that_fails(pipeline: FakePipeline, shown: Shown) -> None:
    pipeline.interrupt = True
    with pytest.raises(KeyboardInterrupt):
        render("a.usda")
    assert shown[-1]._repr_html_() == ""


def test_the_command_line_shows_no_such_bar(pipeline: FakePipeline, shown: Shown, tmp_path: Any) -> None:
    from primray.cli import run

    assert run(["render", "a.usda", "-o", str(tmp_path / "a.exr")]) == 0
    assert not shown


def test_a_terminal_is_no_notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(monkeypatch, SimpleNamespace())
    assert not in_notebook()
    pretend(monkeypatch, None)
    assert not in_notebook()
    with shown_progress(None) as progress:
        assert progress is None


def test_show_in_a_notebook(shown: Shown) -> None:
    image = picture()
    image.show()
    assert shown == [image]
