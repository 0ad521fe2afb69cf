"""The pytest fixture `primray_image`: a stage rendered in a test and compared with a stored reference picture and its error.

    def test_shot(primray_image):
        primray_image("shot.usda", reference="shot.ref.exr", spp=64)

Registered as an entry point, so it is imported in every pytest run: whatever works is imported when the fixture is called.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from .image_check import ImageCheck

_WRITTEN = pytest.StashKey[list[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("primray")
    group.addoption("--primray-update", action="store_true", help="Write the reference pictures of primray_image anew.")
    group.addoption("--primray-evidence", metavar="DIR", help="Keep the pictures of failed primray_image tests below DIR.")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    for path in config.stash.get(_WRITTEN, []):
        terminalreporter.write_line(f"primray: wrote the reference {path}")


@pytest.fixture
def primray_image(request: pytest.FixtureRequest, tmp_path: Path) -> ImageCheck:
    """Called with a stage and a reference, fails the test if the rendered picture has changed. See ImageCheck.__call__."""
    from .image_check import ImageCheck

    config = request.config
    below = config.getoption("--primray-evidence")
    name = re.sub(r"[^\w.-]+", "_", request.node.nodeid).strip("_")
    evidence = Path(below).absolute() / name if below else tmp_path / "primray"
    update = bool(config.getoption("--primray-update"))
    return ImageCheck(request.path.parent, evidence, config.stash.setdefault(_WRITTEN, []) if update else None)
