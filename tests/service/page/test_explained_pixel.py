"""A pixel explained on the page, by Ctrl and a click or by keys: four tables with errors, and the paths that make its noise."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from tests.service.page.conftest import until, wait_for_state
from tests.service.page.scenes import submit, upload

CAPTIONS = ["By light", "By kind of path", "By bounce", "By the prim that sends it here"]
FOCUSED = "document.activeElement.className"


@pytest.fixture(scope="module")
def job(site):
    with site.client() as client:
        return submit(client, upload(client), wait_s=60)


def opened(open_page, job):
    watched = open_page(f"#/jobs/{job}")
    wait_for_state(watched.page, "succeeded")
    until(watched.page, "document.querySelector('.stage img') && document.querySelectorAll('.viewer optgroup').length === 2")
    return watched


def click_with_control(page, x, y):
    """On the middle of a pixel of the picture, which has 48 x 32."""
    box = page.locator(".sheet").bounding_box()
    assert box is not None
    page.keyboard.down("Control")
    page.mouse.click(box["x"] + box["width"] * (x + 0.5) / 48, box["y"] + box["height"] * (y + 0.5) / 32)
    page.keyboard.up("Control")


def rows(page, caption):
    found = page.locator(".explained table", has=page.locator("caption", has_text=caption)).locator("tbody tr")
    return [row.locator("td, th").all_inner_texts() for row in found.all()]


def test_a_click_with_control_explains_the_pixel(open_page, site, job, tmp_path):
    page = opened(open_page, job).page
    panel = page.locator(".explained")
    assert panel.is_hidden()
    click_with_control(page, 24, 24)
    page.locator(".explained table").first.wait_for()
    page.screenshot(path=Path(os.environ.get("PRIMRAY_KEEP", tmp_path), "explained-pixel.png"), full_page=True)
    assert panel.get_by_role("heading", level=2).inner_text() == "Pixel 24, 24"
    assert panel.locator("caption").all_inner_texts() == CAPTIONS
    with site.client() as client:
        said = client.post(f"/v1/jobs/{job}/frames/0/explain", json={"x": 24, "y": 24}, timeout=120).json()
    for name, caption in zip(("light", "kind", "bounce", "prim"), CAPTIONS, strict=True):
        first, shown = said["splits"][name][0], rows(page, caption)
        mark = " ?" if first["rare"] else ""
        assert shown[0][0] == f"{100 * first['share']:.1f} ± {100 * first['share_error']:.1f} %{mark}"
        assert shown[0][2] == first["name"]
    assert said["shown"]["prim"] in panel.locator(".facts").inner_text()
    assert said["noise"][0]["words"] in panel.locator(".worst li").first.inner_text()
    page.keyboard.press("Escape")
    assert panel.is_hidden()


def test_keys_explain_the_picked_pixel(open_page, job):
    page = opened(open_page, job).page
    stage, panel = page.locator(".stage"), page.locator(".explained")
    stage.focus()
    stage.press("Enter")
    assert panel.is_hidden(), "no pixel is picked"
    stage.press("Shift+ArrowUp")
    stage.press("Enter")
    page.locator(".explained table").first.wait_for()
    assert panel.get_by_role("heading", level=2).inner_text() == "Pixel 24, 15"
    assert "Pixel 24, 15 is explained" in page.locator("#say").inner_text()
    panel.get_by_role("button", name="Close").press("Escape")
    assert panel.is_hidden()
    assert page.evaluate(FOCUSED).startswith("stage")
    stage.press("e")  # the picture's other keys are as before
    assert page.locator(".stops").inner_text() == "+0.5"


def test_rare_parts_are_marked_and_refusals_are_said(open_page, job):
    watched = opened(open_page, job)
    page, asked = watched.page, []

    def answer(route):
        asked.append(json.loads(route.request.post_data))
        if len(asked) == 1:
            problem = {"type": "/problems/unavailable", "title": "Not now", "status": 503, "detail": "Wait.", "retryable": True}
            route.fulfill(status=503, content_type="application/problem+json", body=json.dumps(problem))
            return
        found = route.fetch(timeout=120_000).json()
        found["splits"]["light"][0] |= {"rare": True, "ci95": None}
        found["splits"]["prim"] = [found["splits"]["prim"][0] | {"share": 0.75}]
        found["more"]["prim"] = 7
        route.fulfill(json=found)

    watched.expected.add(503)
    page.route("**/explain", answer)
    click_with_control(page, 24, 24)
    page.locator(".explained").get_by_role("button", name="Try again").click()
    page.locator(".explained table").first.wait_for()
    assert asked == [{"x": 24, "y": 24}] * 2
    assert rows(page, "By light")[0][0].endswith(" % ?")
    assert "Paths so rare that the error is hardly known" in page.locator(".explained").inner_text()
    assert rows(page, CAPTIONS[3])[-1] == ["25 %", "", "7 more"]
