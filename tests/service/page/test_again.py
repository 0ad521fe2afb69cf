"""What a failed job offers, and how a sequence is played."""

from __future__ import annotations

from tests.service.page.conftest import until, wait_for_state
from tests.service.page.scenes import SMALL, upload


def test_a_failed_job_is_submitted_again_with_another_camera(open_page, site):
    with site.client() as client:
        asked = {"camera": "/nowhere", "resolution": [48, 32], "stop": {"max_samples": 4}, "seed": 7, "shutter": [0, 0.5]}
        request = {"scene": {"id": upload(client, SMALL)}, "settings": asked, "name": "shot"}
        job = client.post("/v1/jobs", json=request).json()["id"]
    page = open_page(f"#/jobs/{job}").page
    wait_for_state(page, "failed")
    first = page.locator("main > :not(:empty)").nth(1)
    assert "There is no camera /nowhere" in first.inner_text()
    page.get_by_role("link", name="Change the settings and submit again…").click()
    page.wait_for_selector("form.settings")
    camera = page.get_by_label("Camera", exact=True)
    assert camera.locator("option").all_text_contents() == ["/camera", "/side"]
    assert page.get_by_label("Width", exact=True).input_value() == "48"
    camera.select_option("/side")
    assert [page.get_by_label(side, exact=True).input_value() for side in ("Width", "Height")] == ["48", "48"]  # its shape
    with page.expect_response(lambda answer: answer.url.endswith("/v1/jobs") and answer.request.method == "POST") as sent:
        page.get_by_role("button", name="Render", exact=True).click()
    settings = sent.value.request.post_data_json["settings"]
    assert {name: settings[name] for name in ("camera", "seed", "shutter")} == {
        "camera": "/side",
        "seed": 7,
        "shutter": [0, 0.5],
    }
    assert settings["stop"]["max_samples"] == 4
    wait_for_state(page, "succeeded")


def test_the_frames_of_a_sequence_are_played(open_page, site):
    with site.client() as client:
        asked = {"frames": "1:3", "resolution": [48, 32], "stop": {"max_samples": 4}}
        request = {"scene": {"id": upload(client, SMALL)}, "settings": asked}
        job = client.post("/v1/jobs", json=request).json()["id"]
    page = open_page(f"#/jobs/{job}").page
    wait_for_state(page, "succeeded")
    page.get_by_role("button", name="Play", exact=True).click()
    for frame in ("2", "0", "1"):
        until(page, f"document.querySelector('.playing').dataset.frame === '{frame}'")
    page.get_by_role("button", name="Stop", exact=True).click()
    until(page, "document.querySelector('.playing').hidden")
    links = page.get_by_label("Downloads").get_by_role("link").all_text_contents()
    assert len(set(links)) == 9
    assert "beauty.0002.exr" in links
