"""/docs: every operation can be read and tried; a job is made, followed and looked at there. axe finds nothing in it."""

from __future__ import annotations

import re

import pytest
from tests.service.page.conftest import until
from tests.service.page.scenes import SMALL
from tests.service.page.test_axe import RUN, axe, check  # noqa: F401 (a fixture)


def opened(page, operation):
    """The operation's part of the page, its form open."""
    part = page.locator(f"#{operation}")
    part.locator("summary", has_text="Try it").click()
    part.locator("form").wait_for()
    return part


def answered(part, status):
    part.get_by_role("button", name="Send").click()
    part.locator(".answer h4", has_text=re.compile(rf"^{status} ")).wait_for()
    return part.locator(".answer .content")


def named(pattern, text):
    found = re.search(pattern, text)
    assert found is not None, text
    return found[0]


def test_a_job_from_upload_to_picture(open_page):
    page = open_page("docs").page
    part = opened(page, "scenes_upload")
    part.get_by_label("name (query)").fill("small.usda")
    part.get_by_label("Kind of body").select_option("application/octet-stream")
    chosen = {"name": "small.usda", "mimeType": "", "buffer": SMALL.encode() + b"# tried\n"}
    part.get_by_label("File", exact=True).set_input_files(files=[chosen])
    scene = named(r"sha256:\w{64}", answered(part, 201).inner_text())

    part = opened(page, "submissions_submit")
    body = part.get_by_label("Body", exact=True)
    assert scene in body.input_value()  # what the answer before told
    part.get_by_label("Prefer (header)").fill("wait=60")
    body.fill(f'{{"scene": {{"id": "{scene}"}}, "settings": {{"camera": "/camera", "resolution": [64, 40], "spp": 4}}}}')
    job = named(r"job_\w{26}", answered(part, 200).inner_text())
    part.get_by_text("Headers", exact=True).click()
    assert f"location: /v1/jobs/{job}" in part.locator(".answer details pre").inner_text()

    part = opened(page, "events_events")
    assert part.get_by_label("job_id (path, required)").input_value() == job
    part.get_by_label("Answer as").select_option("text/event-stream")
    assert "event: end" in answered(part, 200).inner_text()

    part = opened(page, "previews_preview")
    part.get_by_label("view (query)").select_option("error")
    part.get_by_role("button", name="Send").click()
    part.locator(".answer img").wait_for()
    until(page, "document.querySelector('#previews_preview .answer img').naturalWidth === 64")
    assert re.fullmatch(r"Save \d+ bytes \(image/png\)", part.locator(".answer a").inner_text())


def test_a_refusal_is_shown(open_page):
    watched = open_page("docs")
    watched.expected = {422}
    part = opened(watched.page, "submissions_submit")
    part.get_by_label("Body", exact=True).fill('{"scene": 1}')
    assert '"member": "scene"' in answered(part, 422).inner_text()


def test_the_key_goes_with_a_request(open_page):
    watched = open_page("docs")
    watched.expected = {401}
    watched.page.get_by_label("API key").fill("primray_none")
    part = opened(watched.page, "account_whoami")
    with watched.page.expect_request("**/v1/whoami") as sent:
        answered(part, 401)
    assert sent.value.headers["authorization"] == "Bearer primray_none"


def test_the_keyboard_is_enough(open_page):
    page = open_page("docs#health_alive").page
    part = page.locator("#health_alive")
    part.locator("details.try summary").focus()
    page.keyboard.press("Enter")
    part.locator("form").wait_for()
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    part.locator(".answer h4", has_text="200").wait_for()


@pytest.mark.parametrize(("scheme", "width"), [("dark", 1280), ("light", 360)])
def test_axe_finds_nothing(open_page, axe, scheme, width):  # noqa: F811
    page = open_page("docs", color_scheme=scheme, viewport={"width": width, "height": 900}).page
    page.locator("details.try").first.wait_for()
    parts = "#submissions_submit, #scenes_upload, #previews_preview, #health_alive, #schema-Settings"
    page.evaluate(f"for (const each of document.querySelectorAll('{parts}'))"
                  "for (const one of [each, ...each.querySelectorAll('details')]) one.open = true")  # fmt: skip
    until(page, "document.querySelectorAll('details.try form').length === 4")
    answered(page.locator("#health_alive"), 200)
    check(page, axe, "docs")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.goto(f"{page.url.partition('/docs')[0]}/problems")
    page.evaluate(axe)
    assert page.evaluate(RUN)[0] == []
    assert page.evaluate("document.documentElement.scrollWidth") == width
