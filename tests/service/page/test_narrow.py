"""A phone, 360 pixels wide: nothing sticks out, in any view, whatever the names; and both colour schemes can be read."""

from __future__ import annotations

import pytest
from tests.service.page.conftest import choose, wait_for_state
from tests.service.page.scenes import SMALL, submit, upload

LONG = "a_very_long_name_without_any_place_to_break_it_" * 4


def check_width(page, where):
    found = page.evaluate("""() => [document.documentElement.scrollWidth, [...document.querySelectorAll("main *, header *")]
      .filter((e) => e.checkVisibility() && !e.closest(".stage, .frames, .plot, .unseen, .table-scroll"))
      .filter((e) => e.getBoundingClientRect().right > innerWidth + 0.5).map((e) => e.className || e.tagName)]""")
    assert found == [360, []], where


@pytest.mark.parametrize("scheme", ["dark", pytest.param("light", marks=pytest.mark.long)])
def test_nothing_sticks_out(open_page, site, scheme):
    with site.client() as client:
        scene = upload(client, SMALL + f'def "x" (references = @./{LONG}.usda@)\n{{\n}}\n', name=f"{LONG}.usda")
        jobs = [submit(client, scene, labels={"name": LONG, "shot": LONG}, wait_s=60) for _ in range(2)]
        frames = submit(client, scene, frames="1:3")
        client.post(f"/v1/jobs/{frames}/cancel")
    watched = open_page(viewport={"width": 360, "height": 740}, color_scheme=scheme, has_touch=True, is_mobile=True)
    page = watched.page
    check_width(page, "new")
    choose(page, f"{LONG}.usda", SMALL + "# of a long name")  # equal bytes are one scene with its first name
    page.get_by_text("More", exact=True).click()
    check_width(page, "form")
    page.goto(f"{site.url}/#/jobs/{jobs[0]}")
    wait_for_state(page, "succeeded")
    page.get_by_role("link", name="beauty.exr").wait_for()
    page.get_by_text("Settings and figures").click()
    page.get_by_role("button", name="Continue…").click()
    check_width(page, "job")
    page.goto(f"{site.url}/#/jobs/{frames}")
    page.locator(".chip").first.wait_for()
    check_width(page, "frames")
    watched.expected = {404}  # a cancelled job has samples, but a picture only where somebody asked for it
    page.goto(f"{site.url}/#/jobs")
    page.locator(".jobs li[data-state]").first.wait_for()
    assert page.locator(".jobs li input").first.is_visible()
    check_width(page, "jobs")
    page.goto(f"{site.url}/#/compare/{jobs[0]}/{jobs[1]}")
    page.locator(".layer img").nth(1).wait_for()
    check_width(page, "compare")
    page.goto(f"{site.url}/#/admin")
    page.get_by_role("button", name="Quotas of local").click()
    check_width(page, "admin")
    page.goto(f"{site.url}/#/jobs/job_00000000000000000000000000")
    page.locator(".problem").wait_for()
    check_width(page, "problem")


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_text_has_contrast(open_page, site, scheme):
    """WCAG 2.2, 1.4.3: 4.5 to 1, of the colours that text has on the grounds that it lies on."""
    page = open_page(color_scheme=scheme).page
    ratios = page.evaluate("""() => {
      const style = getComputedStyle(document.documentElement);
      const luminance = (name) => {
        const context = new OffscreenCanvas(1, 1).getContext("2d");
        context.fillStyle = style.getPropertyValue(name);
        context.fillRect(0, 0, 1, 1);
        const [r, g, b] = [...context.getImageData(0, 0, 1, 1).data].map((v) => v / 255)
          .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
      };
      const found = {};
      for (const text of ["--text", "--soft", "--accent", "--bad", "--good", "--goal"]) {
        for (const ground of ["--page", "--card"]) {
          const [a, b] = [luminance(text), luminance(ground)];
          found[`${text} on ${ground}`] = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
        }
      }
      const [a, b] = [luminance("--on-accent"), luminance("--accent")];
      return { ...found, button: (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05) };
    }""")
    assert {name: round(ratio, 2) for name, ratio in ratios.items() if ratio < 4.5} == {}


def test_reduced_motion_is_kept(open_page):
    page = open_page(reduced_motion="reduce").page
    assert page.evaluate("getComputedStyle(document.querySelector('.drop')).transitionDuration") in ("0s", "")
