"""Sliders of a picture's lights: what the browser mixes is what `primray relight` does, with its error."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.service.page.conftest import pictures, until, until_pictures
from tests.service.page.scenes import submit, upload

from primray import LightMix

SLIDE = """([name, value]) => {
  const input = document.querySelector(`[aria-label="${name}"]`);
  input.value = value;
  input.dispatchEvent(new Event("input"));
}"""


@pytest.fixture(scope="module")
def finished(site, tmp_path_factory):
    """A job and the mix of its picture as the library reads it."""
    path = tmp_path_factory.mktemp("mix") / "beauty.exr"
    with site.client() as client:
        job = submit(client, upload(client), wait_s=60, aovs=["lights"])
        path.write_bytes(client.get(f"/v1/jobs/{job}/outputs/beauty.exr").content)
    return job, LightMix.of(path)


def numbers(page):
    """R, G and B under the picked pixel, and its place."""
    words = " ".join(page.locator(".values").inner_text().split())
    at = re.match(r"x (\d+), y (\d+)", words)
    assert at is not None, words
    x, y = at.groups()
    values = dict(re.findall(r"\b([RGB]) ([\d.e-]+)", words))
    return (int(y), int(x)), [float(values[c]) for c in "RGB"]


def test_sliders_mix_lights_as_relight_does(open_page, finished):
    job, mix = finished
    page = open_page(f"#/jobs/{job}").page
    until(page, "document.querySelectorAll('.viewer optgroup').length === 2 && document.querySelector('.stage img')")
    sliders = page.locator(".mix")
    assert sliders.is_hidden()
    before = pictures(page)
    page.get_by_label("View", exact=True).select_option(label="Mix of lights")
    until_pictures(page, before)
    assert sliders.locator(".light > span").all_inner_texts() == list(mix.names)
    stage = page.locator(".stage")
    stage.focus()
    for key in ["Shift+ArrowUp"] * 2 + ["Shift+ArrowLeft"] * 4:
        stage.press(key)
    place, own = numbers(page)
    assert np.allclose(own, mix.image.pixels[place][:3], rtol=1e-3, atol=1e-4)

    # The key a stop brighter and red, the sky off: at once, without another render.
    before = pictures(page)
    page.evaluate(SLIDE, ["Intensity of key, stops", "1"])
    page.evaluate(SLIDE, ["Colour of key", "#ff8000"])
    page.evaluate(SLIDE, ["Intensity of sky, stops", "-6"])
    until_pictures(page, before + 2)
    green = ((128 / 255 + 0.055) / 1.055) ** 2.4
    made = mix.mixed({"key": (2, 2 * green, 0), "sky": 0})
    place, shown = numbers(page)
    assert np.allclose(shown, made.pixels[place][:3], rtol=1e-3, atol=1e-4)
    told = sliders.locator("[role=status]").inner_text()
    error = re.search(r"of the mix: ([\d.e-]+)", told)
    assert error is not None, told
    assert float(error[1]) == pytest.approx(made.report["error"]["relmse"]["estimate"], rel=0.02)
    assert f"key=2,{2 * green:.4g},0 sky=0,0,0" in sliders.locator("code").inner_text()

    before = pictures(page)
    page.get_by_role("button", name="Reset lights").click()
    until_pictures(page, before)
    assert np.allclose(numbers(page)[1], own)
    assert sliders.locator("code").inner_text() == ""


def test_a_single_light_is_a_part_of_its_own(open_page, finished):
    job, mix = finished
    page = open_page(f"#/jobs/{job}").page
    until(page, "document.querySelectorAll('.viewer optgroup').length === 2 && document.querySelector('.stage img')")
    before = pictures(page)
    page.get_by_label("View", exact=True).select_option(label="Lights.key")
    until_pictures(page, before)
    page.locator(".stage").focus()
    page.locator(".stage").press("Shift+ArrowUp")
    place, shown = numbers(page)
    assert np.allclose(shown, mix.parts[mix.names.index("key")].light[place], rtol=1e-3, atol=1e-4)
    assert page.locator(".mix").is_hidden()
