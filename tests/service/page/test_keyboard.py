"""A whole run without a mouse: every step is a key press on what has the focus."""

from __future__ import annotations

import pytest
from playwright.sync_api import FileChooser, FilePayload
from tests.service.page.conftest import until, until_pictures, wait_for_state
from tests.service.page.scenes import SMALL, submit, upload

# A size that is soon rendered.
SETTINGS = 'def RenderSettings "settings"\n{\n    uniform int2 resolution = (96, 64)\n}\n'
FOCUSED = "(() => { const e = document.activeElement; return e.labels?.[0]?.textContent ?? e.ariaLabel ?? e.textContent; })()"
OUTLINE = "getComputedStyle(document.activeElement).outlineStyle"


def tab_to(page, name, most=60):
    """By Tab alone; what has the focus can be seen to have it."""
    for _ in range(most):
        if (page.evaluate(FOCUSED) or "").strip().startswith(name):
            return
        page.keyboard.press("Tab")
        assert page.evaluate(OUTLINE) != "none", page.evaluate(FOCUSED)
    raise AssertionError(f"{name} is not reached by Tab")


def test_a_run_by_keyboard_alone(open_page):
    page = open_page().page
    page.wait_for_load_state("networkidle")  # what comes late may move the focus
    page.keyboard.press("Tab")
    assert page.evaluate(FOCUSED) == "To the content"
    choosers: list[FileChooser] = []
    page.on("filechooser", lambda chooser: choosers.append(chooser))
    for _ in range(20):  # the browser may still be arranging that choosers come to us
        tab_to(page, "Choose a file")
        page.keyboard.press("Enter")
        page.wait_for_timeout(500)
        if choosers:
            break
    chosen: FilePayload = {"name": "keys.usda", "mimeType": "", "buffer": (SMALL + SETTINGS).encode()}
    choosers[0].set_files([chosen])
    page.wait_for_selector("form.settings")
    assert page.evaluate(FOCUSED) == "Render"  # the next step is one key away
    for _ in range(3):
        page.keyboard.press("Shift+Tab")
    tab_to(page, "Or after samples")
    page.keyboard.press("Shift+Tab")
    assert page.evaluate(FOCUSED) == "Or after seconds"
    page.keyboard.press("ControlOrMeta+a")
    page.keyboard.type("60")
    page.keyboard.press("Shift+Tab")
    assert page.evaluate(FOCUSED) == "Estimate the times"
    page.keyboard.press("Shift+Tab")
    page.keyboard.type("1e-9")
    page.keyboard.press("Enter")
    page.wait_for_url("**#/jobs/job_*")
    page.wait_for_selector(".stage img")
    tab_to(page, "The picture")
    scale = "new DOMMatrix(getComputedStyle(document.querySelector('.sheet')).transform)"
    fitted = page.evaluate(f"{scale}.a")
    page.keyboard.press("+")
    assert page.evaluate(f"{scale}.a") > fitted
    left = page.evaluate(f"{scale}.e")
    page.keyboard.press("ArrowRight")
    assert page.evaluate(f"{scale}.e") == left - 40
    page.keyboard.press("0")
    assert page.evaluate(f"{scale}.a") >= fitted
    page.keyboard.press("Shift+ArrowUp")
    until(page, r"/\d\.\d{4}/.test(document.querySelector('.values').textContent)")
    page.keyboard.press("Escape")
    assert page.locator(".values").inner_text() == ""
    shown = int(page.locator(".viewer").get_attribute("data-pictures") or 0)
    tab_to(page, "Exposure")
    page.keyboard.press("ArrowRight")
    until(page, "document.querySelector('.stops').textContent === '+0.25'")
    until_pictures(page, shown)
    tab_to(page, "Cancel")
    page.keyboard.press("Enter")
    wait_for_state(page, "canceled")
    tab_to(page, "Delete")
    page.keyboard.press("Enter")
    assert page.evaluate(FOCUSED) == "Delete it"
    page.keyboard.press("Enter")
    page.wait_for_url("**/#/jobs")


def test_progress_is_announced(open_page, site):
    with site.client() as client:
        job = submit(client, upload(client), wait_s=60)
    page = open_page(f"#/jobs/{job}").page
    until(page, "document.getElementById('say').textContent.endsWith('finished.')")
    assert page.locator("#say").get_attribute("aria-live") == "polite"


@pytest.mark.long
def test_every_control_has_a_name(open_page, site):
    with site.client() as client:
        scene = upload(client)
        jobs = [submit(client, scene, wait_s=60) for _ in range(2)]
    for fragment in ("", "#/jobs", f"#/jobs/{jobs[0]}", f"#/compare/{jobs[0]}/{jobs[1]}"):
        page = open_page(fragment).page
        page.wait_for_load_state("networkidle")
        nameless = page.evaluate("""() => [...document.querySelectorAll("button, a, input, select, textarea, [tabindex]")]
          .filter((e) => e.checkVisibility() && e.id !== "main" && !e.ariaHidden)
          .filter((e) => !(e.ariaLabel || e.labels?.[0]?.textContent || e.textContent.trim()))
          .map((e) => e.outerHTML)""")
        assert nameless == [], fragment
