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
    from .failure_page import Failure
    from .image_check import ImageCheck

_WRITTEN = pytest.StashKey[list[str]]()
_PAGE = "--primray-html"
_PLAIN = re.compile(r"[a-z0-9_.-]{1,80}\.py::[a-z0-9_]{1,80}")
_LONGEST = 120
_EVIDENCE = "primray-evidence"  # a test's property: where the evidence of a failure is


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("primray")
    group.addoption("--primray-update", action="store_true", help="Write the reference pictures of primray_image anew.")
    group.addoption("--primray-evidence", metavar="DIR", help="Keep the pictures of failed primray_image tests below DIR.")
    group.addoption(_PAGE, metavar="FILE", help="Write one HTML page of the failed primray_image tests.")


def pytest_configure(config: pytest.Config) -> None:
    page = config.getoption(_PAGE)
    if page and not hasattr(config, "workerinput"):  # pytest-xdist: who runs tests for another writes none
        config.pluginmanager.register(_Page(Path(page).absolute()), "primray-page")


class _Page:
    """Collects failures as they are reported, while their evidence is there, and writes the page at the end."""

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
    """A folder's name for a test and for no other: what names of tests may hold and folders not is replaced, upper and lower
    case are one on some systems, and names end after 255 bytes. So all but the plainest end in a digest of the test's name."""
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
    """Called with a stage and a reference, fails the test if the rendered picture has changed. See ImageCheck.__call__."""
    from .image_check import ImageCheck

    config = request.config
    below = config.getoption("--primray-evidence")
    evidence = Path(below).absolute() / _folder_of(request.node.nodeid, config) if below else tmp_path / "primray"
    update = bool(config.getoption("--primray-update"))
    written = config.stash.setdefault(_WRITTEN, []) if update else None
    failed: list[tuple[str, object]] = request.node.user_properties
    return ImageCheck(request.path.parent, evidence, written, lambda kept: failed.append((_EVIDENCE, str(kept))))
