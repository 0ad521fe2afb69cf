"""From a dropped file to a picture that refines, is canceled, goes on, is fetched and deleted: real renders, a real browser."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pytest
from tests.service.page.conftest import choose, pictures, render, until, until_pictures, wait_for_state
from tests.service.page.scenes import FOREVER, SMALL, submit, upload

DROP = """(text) => {
  const transfer = new DataTransfer();
  transfer.items.add(new File([text], "dropped.usda"));
  for (const type of ["dragover", "drop"]) {
    const event = new DragEvent(type, { bubbles: true, cancelable: true, dataTransfer: transfer });
    document.querySelector(".drop").dispatchEvent(event);
  }
}"""


def test_a_dropped_scene_fills_the_form(open_page):
    page = open_page().page
    page.evaluate(DROP, SMALL + "# dropped")
    page.wait_for_selector("form.settings")
    camera = page.get_by_label("Camera", exact=True)
    assert camera.locator("option").all_text_contents() == ["/camera", "/side"]
    assert page.get_by_label("Name", exact=True).input_value() == "dropped.usda"
    width, height = page.get_by_label("Width", exact=True), page.get_by_label("Height", exact=True)
    assert int(width.input_value()) / int(height.input_value()) == 1.5
    camera.select_option("/side")
    assert width.input_value() == height.input_value()
    width.fill("200")
    assert height.input_value() == "200"
    page.get_by_role("button", name="half").click()
    assert width.input_value() == "480"
    assert page.get_by_label("Frames", exact=True).input_value() == "1:3"
    # What the form sends is what was chosen.
    page.get_by_label("Clean").check()
    page.get_by_label("Or after samples a pixel").fill("4")
    page.get_by_text("More", exact=True).click()
    page.get_by_label("Seed").fill("7")
    page.get_by_label("Labels").fill("shot = 010\nartist=Ada = B")
    with page.expect_response(lambda answer: answer.url.endswith("/v1/jobs") and answer.request.method == "POST") as sent:
        page.get_by_role("button", name="Render", exact=True).click()
    asked = sent.value.request.post_data_json
    assert asked["settings"]["camera"] == "/side"
    assert asked["settings"]["resolution"] == [480, 480]
    assert asked["settings"]["stop"] == {"target_error": 0.001, "max_seconds": 600, "max_samples": 4}
    assert asked["settings"]["seed"] == 7
    assert asked["labels"] == {"name": "dropped.usda", "shot": "010", "artist": "Ada = B"}
    wait_for_state(page, "succeeded")


def test_a_picture_refines_is_canceled_and_goes_on(open_page, site):
    page = open_page().page
    choose(page, content=SMALL + "# refines")
    job = render(page, width=180, target="0.0000001")
    page.wait_for_selector(".stage img")
    # It refines: pictures take each other's place, the curve gets rows, the error is told with its target.
    until_pictures(page, 2)
    until(page, "/after .* target 1·10⁻⁷/.test(document.querySelector('.curve .unseen').textContent)")
    assert page.locator(".uplot canvas").count() == 1
    assert re.fullmatch(r"\d+ %", page.title().split(" · ")[0])
    assert page.get_by_role("progressbar", name="Progress").is_visible()
    # Values under the cursor, by mouse and by keys, are those of the raw preview.
    page.locator(".stage").hover()
    until(page, r"/\d\.\d{4}/.test(document.querySelector('.values').textContent)")
    page.get_by_role("button", name="Cancel").click()
    wait_for_state(page, "canceled")
    with site.client() as client:
        assert client.get(f"/v1/jobs/{job}").json()["state"] == "canceled"
        before = client.get(f"/v1/jobs/{job}").json()["progress"]["samples_done"]
        before_pictures = pictures(page)
        # It goes on from there, and ends by its new rule.
        page.get_by_role("button", name="Continue…").click()
        page.get_by_label("Target error").fill("")
        page.get_by_label("Or samples a pixel in all").fill(str(int(before) + 16))
        page.get_by_label("Or seconds in all").fill("")
        page.get_by_role("button", name="Continue rendering").click()
        wait_for_state(page, "succeeded", 60)
        after = client.get(f"/v1/jobs/{job}").json()
        assert after["attempt"] == 2
        assert after["progress"]["samples_done"] > before
    until_pictures(page, before_pictures)


def test_files_come_with_their_digest_and_a_job_can_be_deleted(open_page, site):
    with site.client() as client:
        job = submit(client, upload(client), wait_s=60)
        page = open_page(f"#/jobs/{job}").page
        link = page.get_by_role("link", name="beauty.exr")
        link.wait_for()
        with page.expect_download() as download:
            link.click()
        content = Path(download.value.path()).read_bytes()
        row = link.locator("xpath=..")
        assert row.locator("code").get_attribute("title") == hashlib.sha256(content).hexdigest()
        assert content[:4] == bytes([0x76, 0x2F, 0x31, 0x01])
        page.get_by_role("button", name="Delete", exact=True).click()
        page.get_by_role("button", name="Keep it").click()
        page.get_by_role("button", name="Delete", exact=True).click()
        page.get_by_role("button", name="Delete it").click()
        page.wait_for_url("**/#/jobs")
        assert client.get(f"/v1/jobs/{job}").status_code == 404


def test_exposure_channel_view_and_zoom(open_page, site):
    with site.client() as client:
        job = submit(client, upload(client), wait_s=60)
    page = open_page(f"#/jobs/{job}").page
    page.wait_for_selector(".stage img")
    mean = """async () => {
      const image = document.querySelector(".stage img");
      const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
      const context = canvas.getContext("2d");
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
      let [sum, gray] = [0, true];
      for (let at = 0; at < data.length; at += 4) {
        sum += data[at] + data[at + 1] + data[at + 2];
        gray = gray && data[at] === data[at + 1] && data[at] === data[at + 2];
      }
      return [(4 * sum) / (3 * data.length), gray];
    }"""
    dark, is_gray = page.evaluate(mean)
    assert not is_gray
    before = pictures(page)
    page.get_by_label("Exposure, stops").fill("2")
    until_pictures(page, before)
    bright, _ = page.evaluate(mean)
    assert bright > 1.2 * dark
    before = pictures(page)
    page.get_by_label("Channel").select_option("luminance")
    until_pictures(page, before)
    assert page.evaluate(mean)[1]
    before = pictures(page)
    page.get_by_label("View", exact=True).select_option("error")
    until_pictures(page, before)
    assert "standard error" in page.locator(".legend").inner_text()
    page.get_by_role("button", name="Reset exposure").click()
    # Zoom: in by button, fit again.
    page.get_by_role("button", name="Fit").click()
    scale = "new DOMMatrix(getComputedStyle(document.querySelector('.sheet')).transform).a"
    fitted = page.evaluate(scale)
    page.get_by_role("button", name="Zoom in").click()
    assert page.evaluate(scale) > fitted
    page.get_by_role("button", name="Fit").click()
    assert page.evaluate(scale) == fitted
    box = page.locator(".stage").bounding_box()
    assert box is not None
    page.mouse.dblclick(box["x"] + 10, box["y"] + 10)
    assert page.evaluate(scale) > fitted


def test_frames_have_a_strip(open_page, site):
    with site.client() as client:
        job = submit(client, upload(client), frames="1:3")
    page = open_page(f"#/jobs/{job}").page
    wait_for_state(page, "succeeded", 60)
    chips = page.locator(".chip")
    assert chips.count() == 3
    assert [chip.locator("b").inner_text() for chip in chips.all()] == ["1", "2", "3"]
    assert {chip.get_attribute("data-state") for chip in chips.all()} == {"succeeded"}
    with page.expect_response(lambda answer: "/preview?" in answer.url and "frame=1&" in answer.url):
        chips.nth(1).click()
    assert chips.nth(1).get_attribute("aria-pressed") == "true"
    assert page.get_by_role("button", name="Follow").get_attribute("aria-pressed") == "false"


def test_the_list_filters_and_leads_to_comparing(open_page, site):
    with site.client() as client:
        scene = upload(client, SMALL + "# listed", name="listed small.usda")
        jobs = [submit(client, scene, labels={"shot": "list"}, wait_s=60, seed=seed) for seed in (1, 2)]
    page = open_page("#/jobs").page
    page.get_by_label("Label", exact=True).fill("shot: list")
    page.get_by_label("Label", exact=True).press("Enter")
    rows = page.locator(".jobs li[data-state]")
    until(page, "document.querySelectorAll('.jobs li[data-state]').length === 2")
    assert rows.locator("img").count() == 2
    page.get_by_label("Name", exact=True).fill("no such")
    page.get_by_text("No job matches.").wait_for()
    page.get_by_label("Name", exact=True).fill("SMALL list")
    until(page, "document.querySelectorAll('.jobs li[data-state]').length === 2")
    for box in rows.locator("input").all():
        box.check()
    page.get_by_role("link", name="Compare the two").click()
    page.wait_for_selector(".viewer:not([hidden])")
    assert set(page.url.split("/")[-2:]) == set(jobs)
    page.goto(f"{site.url}/#/jobs")
    page.get_by_label("Label", exact=True).fill("shot: list")  # jobs of other tests, which share the server, may have failed
    page.get_by_label("State").select_option("failed")
    page.get_by_text("No job matches.").wait_for()


def test_notes_stand_beside_their_prims(open_page, site):
    scene = SMALL + 'def Sphere "volume" (\n)\n{\n}\ndef "x" (references = @./gone.usda@)\n{\n}\n'
    with site.client() as client:
        job = submit(client, upload(client, scene), wait_s=60)
    page = open_page(f"#/jobs/{job}").page
    page.get_by_text("gone.usda").first.wait_for()
    groups = page.locator(".diagnostics .group")
    # By severity, in the words of reports; then by prim, or by kind.
    severities = [words.split(" (")[0] for words in groups.locator("h3").all_inner_texts()]
    assert severities == [severity for severity in ("error", "warning", "info") if severity in severities]
    assert len(severities) == 2
    assert "composition-error /x" in " ".join(page.locator(".diagnostics").inner_text().split())
    page.get_by_label("Group by").select_option("prim")
    assert "/x" in groups.locator("h3").all_inner_texts()
    assert "/post" in groups.locator("h3").all_inner_texts()
    page.get_by_label("Filter").fill("gone")
    assert groups.locator("h3").all_inner_texts() == ["/x"]
    page.get_by_label("Filter").fill("")
    page.get_by_label("Group by").select_option("code")
    assert "composition-error" in groups.locator("h3").all_inner_texts()
    page.get_by_label("Filter").fill("no such thing")
    page.get_by_text("None of the notes matches.").wait_for()


@pytest.mark.long
def test_a_queued_job_says_so(open_page, site):
    """While another runs in the only slot."""
    with site.client() as client:
        scene = upload(client)
        running = submit(client, scene, stop=FOREVER)
        waiting = submit(client, scene, stop=FOREVER)
        page = open_page(f"#/jobs/{waiting}").page
        page.get_by_text("waiting for its turn").first.wait_for()
        assert page.get_by_text("Waiting for the first picture").is_visible()
        page.get_by_role("button", name="Cancel").click()
        wait_for_state(page, "canceled")
        page.get_by_text("There is no picture").wait_for()
        client.post(f"/v1/jobs/{running}/cancel")
