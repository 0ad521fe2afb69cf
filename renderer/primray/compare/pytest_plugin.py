"""The pytest fixture `primray_image`: a stage rendered in a test and compared with a stored reference picture and its error.

    def test_shot(primray_image):
        primray_image("shot.usda", reference="shot.ref.exr", spp=64)

The module is an entry point and imported in every pytest run, so everything else is imported only when the fixture is called.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from .failure_page import Failure
    from .image_check import ImageCheck

_WRITTEN = pytest.StashKey[list[str]]()
_PAGE = "--primray-html"
_PLAIN = re.compile(r"[a-z0-9_.-]{1,80}\.py::[a-z0-9_]{1,80}")
_LONGEST = 120
_EVIDENCE = "primray-evidence"  # test property with the folder of a failure's evidence


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("primray")
    group.addoption("--primray-update", action="store_true", help="Render the reference pictures of primray_image again.")
    group.addoption("--primray-evidence", metavar="DIR", help="Keep the pictures of failed primray_image tests below DIR.")
    group.addoption(_PAGE, metavar="FILE", help="Write one HTML page of the failed primray_image tests.")


def pytest_configure(config: pytest.Config) -> None:
    page = config.getoption(_PAGE)
    if page and not hasattr(config, "workerinput"):  # workers of pytest-xdist write no page
        config.pluginmanager.register(_Page(Path(page).absolute()), "primray-page")


class _Page:
    """Collector of failures, which writes the page at the end.

    Failures are read as they are reported, while their evidence exists.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.failures: list[Failure] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when != "call" or not report.failed:
            return
        from .failure_page import failure_of

        kept = [str(value) for name, value in report.user_properties if name == _EVIDENCE]
        self.failures += [failure_of(report.nodeid, Path(folder)) for folder in kept]

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        from .failure_page import write_page

        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_page(self.failures, self.path)
        terminalreporter.write_line(f"primray: wrote the failures to {self.path}")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    for path in config.stash.get(_WRITTEN, []):
        terminalreporter.write_line(f"primray: wrote the reference {path}")


def _folder_of(test: str, config: pytest.Config) -> str:
    """Return a folder name unique to a test.

    Characters not allowed in folder names are replaced; some systems ignore case, and names are limited to 255 bytes, so all
    but the plainest names end in a digest of the test's name.
    """
    name = re.sub(r"[^\w.-]+", "_", test).strip("_")
    if not _PLAIN.fullmatch(test):
        import hashlib

        digest = hashlib.sha256(test.encode("utf-8", "surrogatepass")).hexdigest()[:10]
        name = f"{name.encode('ascii', 'replace').decode().replace('?', '_')[:_LONGEST]}-{digest}"
    worker = getattr(config, "workerinput", {}).get("workerid", "")
    each = worker and config.getoption("dist", None) == "each"  # pytest-xdist: every worker runs every test
    return f"{name}-{worker}" if each else name


@pytest.fixture
def primray_image(request: pytest.FixtureRequest, tmp_path: Path) -> ImageCheck:
    """Return a callable that fails the test if the picture of a stage differs from its reference. See ImageCheck.__call__."""
    from .image_check import ImageCheck

    config = request.config
    below = config.getoption("--primray-evidence")
    evidence = Path(below).absolute() / _folder_of(request.node.nodeid, config) if below else tmp_path / "primray"
    update = bool(config.getoption("--primray-update"))
    written = config.stash.setdefault(_WRITTEN, []) if update else None
    failed: list[tuple[str, object]] = request.node.user_properties
    return ImageCheck(request.path.parent, evidence, written, lambda kept: failed.append((_EVIDENCE, str(kept))))
