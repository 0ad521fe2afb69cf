"""What goes wrong is said: what, where and what to do; and what others wrote is shown as text, whatever it looks like."""

from __future__ import annotations

import pytest
from tests.service.page.conftest import choose, until, wait_for_state
from tests.service.page.scenes import FOREVER, SMALL, submit, upload

from primray_service.problems import KINDS

MARKUP = "<img src=x onerror=document.title='run'><script>document.title='run'</script>"


def test_markup_is_shown_as_text(open_page, site):
    scene = SMALL + f'def "x" (references = @./{MARKUP.replace("/", "")}.usda@)\n{{\n}}\n'
    with site.client() as client:
        job = submit(
            client, upload(client, scene, name=f"{MARKUP}.usda"), labels={"name": MARKUP, MARKUP[:40].replace("=", ""): MARKUP}
        )
    page = open_page(f"#/jobs/{job}").page
    wait_for_state(page, "succeeded", 60)
    assert page.locator("h1").inner_text() == MARKUP
    assert MARKUP in page.locator(".head .labels").inner_text()
    page.get_by_text("onerror=document.title").nth(2).wait_for()
    assert page.locator("main img:not(.stage img), main script").count() == 0
    page.goto(f"{site.url}/#/jobs")
    page.get_by_role("link", name=MARKUP).first.wait_for()
    assert page.locator("main img:not(.thumb), main script").count() == 0
    assert page.title() == "primray"


def test_a_file_that_is_no_scene(open_page):
    watched = open_page()
    page = watched.page
    watched.expected = {422}
    chosen = {"name": "notes.usda", "mimeType": "", "buffer": b"These are notes."}
    page.set_input_files("input[type=file]:not([webkitdirectory])", files=[chosen])
    box = page.locator(".problem")
    box.wait_for()
    assert KINDS["not-usd"].title in box.inner_text()
    assert "Upload a .usda" in box.inner_text()
    # Files without any layer are not even sent.
    page.set_input_files("input[type=file]:not([webkitdirectory])", files=[chosen | {"name": "notes.txt"}] * 2)
    page.get_by_text("None of these files is a USD layer").wait_for()


def test_a_layer_that_cannot_be_read_is_named_with_its_line(open_page):
    page = open_page().page
    chosen = {"name": "broken.usda", "mimeType": "", "buffer": b'#usda 1.0\ndef Sphere "a"\n{\n    double radius = = 1\n}\n'}
    page.set_input_files("input[type=file]:not([webkitdirectory])", files=[chosen])
    box = page.locator(".problem")
    box.wait_for()
    assert KINDS["layer-unreadable"].title in box.inner_text()
    assert box.locator("dl").inner_text().split()[:4] == ["Layer", "broken.usda", "Line", "4"]


def test_settings_that_are_refused_keep_the_form(open_page):
    watched = open_page()
    page = watched.page
    watched.expected = {422}
    choose(page)
    page.get_by_label("several frames").check()
    page.get_by_label("Frames", exact=True).fill("1:x")
    page.get_by_role("button", name="Render", exact=True).click()
    box = page.locator("form .problem")
    box.wait_for()
    assert "settings.frames" in box.inner_text()
    page.get_by_label("Frames", exact=True).fill("1:2")
    page.get_by_label("Or after samples a pixel").fill("2")
    page.get_by_role("button", name="Render", exact=True).click()
    page.wait_for_url("**#/jobs/job_*")


def test_a_job_that_is_not_there(open_page):
    watched = open_page()
    watched.expected = {404}
    watched.page.goto(watched.page.url + "#/jobs/job_00000000000000000000000000")
    watched.page.get_by_text("It may have been deleted").wait_for()
    watched.page.goto(watched.page.url.split("#")[0] + "#/nowhere")
    watched.page.get_by_text("Page not found").wait_for()


def test_every_problem_has_advice(open_page):
    page = open_page().page
    script = """async (slugs) => {
      const { adviceFor } = await import("/page/base/words.js");
      return slugs.filter((slug) => !adviceFor({ type: slug }));
    }"""
    # A browser cannot cause these, or what to do is in their detail.
    own = {"invalid-json", "method-not-allowed", "not-acceptable", "unsupported-media-type", "range-not-satisfiable"}
    own |= {"precondition-failed", "idempotency-key-reused", "request-too-large", "view-unavailable", "webhook-address"}
    own |= {"host-not-allowed", "cross-origin"}
    assert set(page.evaluate(script, [f"/problems/{slug}" for slug in KINDS])) <= {f"/problems/{slug}" for slug in own}


@pytest.mark.long
def test_the_picture_goes_on_after_the_server_was_away(open_page, start_server):
    server = start_server()
    with server.client() as client:
        job = submit(client, upload(client), stop=FOREVER, resolution=[300, 200])
    watched = open_page(f"#/jobs/{job}", url=server.url)
    page = watched.page
    page.wait_for_selector(".stage img", timeout=60_000)
    port = int(server.url.rpartition(":")[2])
    server.stop()
    page.get_by_text("The connection was lost; trying again.").wait_for()
    watched.wrong.clear()  # refused connections are told in the console
    start_server(server.data, port=port)
    until(page, "!document.body.textContent.includes('The connection was lost')", 60)
    watched.wrong.clear()
    before = page.evaluate("Number(document.querySelector('.viewer').dataset.pictures)")
    until(page, f"Number(document.querySelector('.viewer').dataset.pictures) > {before}", 60)
    page.get_by_role("button", name="Cancel").click()
    wait_for_state(page, "canceled")
