"""No view has what axe-core finds wrong for people who use a keyboard, a screen reader or large type, in either theme."""

from __future__ import annotations

from importlib.resources import files

import pytest
from tests.service.page.conftest import choose, until, wait_for_state
from tests.service.page.scenes import SMALL, submit, upload

RUN = """async () => {
  const { violations, passes } = await axe.run();
  const told = violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target.join(" ")).join(", ")}`);
  return [told, passes.length];
}"""


@pytest.fixture(scope="module")
def axe():
    return files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")


def check(page, axe, where):
    page.evaluate(axe)
    wrong, passed = page.evaluate(RUN)
    assert wrong == [], where
    assert passed > 15, where


@pytest.mark.parametrize(("scheme", "width"), [("dark", 1280), ("light", 360)])
def test_axe_finds_nothing(open_page, site, axe, scheme, width):
    scene = SMALL + 'def "x" (references = @./gone.usda@)\n{\n}\n'
    with site.client() as client:
        job = submit(client, upload(client, scene), wait_s=60, aovs=["prim", "depth"])
    page = open_page(color_scheme=scheme, viewport={"width": width, "height": 900}).page
    check(page, axe, "first visit")
    choose(page, content=scene)
    for words in ("Outputs and purposes", "More"):
        page.get_by_text(words, exact=True).click()
    check(page, axe, "form")
    page.goto(f"{site.url}/#/jobs/{job}")
    wait_for_state(page, "succeeded")
    until(page, "document.querySelectorAll('.viewer optgroup').length === 2")
    page.get_by_label("View", exact=True).select_option(label="Depth")
    for words in ("Histogram", "Settings and figures"):
        page.get_by_text(words, exact=True).click()
    until(page, "document.querySelector('.histogram .note').textContent !== ''")
    check(page, axe, "job")
    page.locator(".stage").focus()
    for key in ("Shift+ArrowDown", "Enter"):
        page.locator(".stage").press(key)
    page.locator(".explained table").first.wait_for()
    check(page, axe, "pixel")
    page.goto(f"{site.url}/#/jobs")
    page.locator(".jobs li[data-state]").first.wait_for()
    check(page, axe, "jobs")
    page.goto(f"{site.url}/#/compare/{job}/{job}")
    page.locator(".layer img").nth(1).wait_for()
    check(page, axe, "compare")
    page.goto(f"{site.url}/#/admin")
    page.get_by_role("button", name="Quotas of local").click()
    check(page, axe, "admin")


def test_axe_would_find_something(open_page, axe):
    page = open_page().page
    page.evaluate("document.getElementById('main').append(document.createElement('input'))")
    page.evaluate(axe)
    assert any(words.startswith("label") for words in page.evaluate(RUN)[0])
