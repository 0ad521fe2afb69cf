"""The viewer shows every part of a job's EXR: as pictures, as values under the pointer, and with the prims that are there."""

from __future__ import annotations

import re
import tempfile

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.service.page.conftest import pictures, until, until_pictures
from tests.service.page.scenes import SMALL, submit, upload

from primray.images.exr_parts import read_aovs

AOVS = ["depth", "normal", "albedo", "prim", "samples", "crypto_object"]
SCALE = "new DOMMatrix(getComputedStyle(document.querySelector('.sheet')).transform).a"
PIXEL = """([x, y]) => {
  const canvas = document.querySelector(".sheet > canvas");
  return canvas.hidden ? null : [...canvas.getContext("2d").getImageData(x, y, 1, 1).data];
}"""


@pytest.fixture(scope="module")
def finished(site, tmp_path_factory):
    """A job and its AOVs as the library reads them."""
    path = tmp_path_factory.mktemp("parts") / "beauty.exr"
    with site.client() as client:
        job = submit(client, upload(client), wait_s=60, aovs=AOVS)
        path.write_bytes(client.get(f"/v1/jobs/{job}/outputs/beauty.exr").content)
    return job, read_aovs(path)


def values(page):
    return " ".join(page.locator(".values").inner_text().split())


def test_every_part_is_shown_with_its_values(open_page, finished):
    job, aovs = finished
    page = open_page(f"#/jobs/{job}").page
    until(page, "document.querySelectorAll('.viewer optgroup').length === 2 && document.querySelector('.stage img')")
    view = page.get_by_label("View", exact=True)
    assert view.locator("option").all_inner_texts() == [
        *("Picture", "Error", "Error, relative", "Picture", "Picture: standard error"),
        *("Depth", "Normal", "Albedo", "Prim", "Samples of a pixel", "Crypto object"),
    ]
    stage = page.locator(".stage")
    x, y = 20, 14
    said: dict[str, tuple[str, list[int], str]] = {}
    for label in ("Depth", "Normal", "Albedo", "Prim", "Samples of a pixel", "Crypto object"):
        before = pictures(page)
        view.select_option(label=label)
        until_pictures(page, before)
        if not said:  # the pixel in the middle, then some to the left and up; it stays picked
            stage.focus()
            for key in ["Shift+ArrowUp"] * 2 + ["Shift+ArrowLeft"] * 4:
                stage.press(key)
        said[label] = (values(page), page.evaluate(PIXEL, [x, y]), page.locator(".legend").inner_text())
    assert all(words.startswith(f"x {x}, y {y}") for words, _, _ in said.values())
    words, pixel, legend = said["Normal"]
    normal = aovs["normal"].values[y, x]
    assert f"X {normal[0]:.4f} Y {normal[1]:.4f} Z {normal[2]:.4f}" in words
    assert np.abs(np.array(pixel[:3]) - (127.5 + 127.5 * normal)).max() <= 0.51
    assert "X, Y and Z as red, green and blue" in legend
    assert f"{aovs['depth'].values[y, x, 0]:.4f}" in said["Depth"][0]
    assert "R 0.8000 G 0.3000 B 0.1000" in said["Albedo"][0]
    assert said["Albedo"][1] == [231, 149, 89, 255]  # plain sRGB
    assert "/ball" in said["Albedo"][0]  # in every view, the prim that is there
    number = int(aovs["prim"].values[y, x, 0])
    assert f"{number} display" in said["Prim"][0]
    assert aovs["prim"].ids[number] == "/ball"
    assert said["Prim"][0].endswith("/ball")
    assert "/ball 100 %" in said["Crypto object"][0]
    assert "8" in said["Samples of a pixel"][0]
    assert len({tuple(said[name][1]) for name in ("Depth", "Normal", "Albedo", "Prim", "Crypto object")}) == 5


def test_keys_wheel_false_colour_and_histogram(open_page, finished):
    job, _ = finished
    page = open_page(f"#/jobs/{job}").page
    page.wait_for_selector(".stage img")
    assert page.locator(".zoom-text").inner_text() == "100 %"  # no picture is larger than it is, at first
    stage = page.locator(".stage")
    stage.hover()
    page.mouse.wheel(0, -100)
    until(page, f"{SCALE} === 1.25")
    stage.focus()
    stage.press("0")
    assert page.evaluate(SCALE) >= 2
    # Exposure by keys: the values stay, what is shown gets brighter; the prim is told in the picture, too.
    for key in ("Shift+ArrowUp", "Shift+ArrowLeft"):
        stage.press(key)
    until(page, r"/± .*display \d+ \d+ \d+.*\/\w+/s.test(document.querySelector('.values').textContent)")
    before = pictures(page)
    stage.press("e")
    stage.press("e")
    stage.press("Shift+E")
    until(page, "document.querySelector('.stops').textContent === '+0.5'")
    until_pictures(page, before)
    # The histogram is of what is shown, at its exposure.
    page.get_by_text("Histogram", exact=True).click()
    until(page, r"/Above white [\d.]+ %/.test(document.querySelector('.histogram .note').textContent)")
    stage.press("Shift+E")
    until(page, "document.querySelector('.stops').textContent === '0'")
    # False colours: by stops around mid-grey, with their scale.
    page.get_by_label("Look").select_option("false")
    until(page, "!document.querySelector('.sheet > canvas').hidden")
    until(page, "document.querySelector('.legend').innerText.includes('0.0028')")  # drawn with the picture, at its exposure
    legend = page.locator(".legend").inner_text()
    assert "12" in legend
    assert "luminance" in legend
    page.get_by_label("Look").select_option("display")
    until(page, "document.querySelector('.sheet > canvas').hidden && !document.querySelector('.stage img').hidden")
    stage.press("v")
    assert page.get_by_label("View", exact=True).input_value() == "error"
    until(page, "document.querySelector('.legend').textContent.includes('standard error')")


def test_a_region_is_rendered_by_itself(open_page, finished):
    """Marked by a drag or by numbers; what comes is those pixels of the whole, by their own job."""
    job, aovs = finished
    page = open_page(f"#/jobs/{job}").page
    page.wait_for_selector(".stage img")
    page.get_by_role("button", name="Region…").click()
    image = page.locator(".stage img").bounding_box()
    assert image is not None
    assert (image["width"], image["height"]) == (48, 32)
    page.mouse.move(image["x"] + 24, image["y"] + 24)
    page.mouse.down()
    page.mouse.move(image["x"] + 12, image["y"] + 8, steps=3)
    page.mouse.up()
    sides = ["Left", "Top", "Right", "Bottom"]
    assert [page.get_by_label(f"{side}, per cent").input_value() for side in sides] == ["25.0", "25.0", "50.0", "75.0"]
    assert page.locator(".region-panel").get_by_text("12 × 16 pixels").is_visible()
    page.get_by_label("Right, per cent").fill("75")
    with page.expect_response(lambda answer: answer.url.endswith("/v1/jobs") and answer.request.method == "POST") as sent:
        page.get_by_role("button", name="Render this region").click()
    assert sent.value.request.post_data_json["settings"]["region"] == [0.25, 0.25, 0.75, 0.75]
    page.wait_for_url(lambda url: "#/jobs/job_" in url and job not in url)
    until(page, "document.querySelectorAll('.viewer optgroup').length === 2 && document.querySelector('.stage img')")
    assert page.evaluate("document.querySelector('.stage img').naturalWidth") == 24
    assert page.locator("h1").inner_text().startswith("region of ")
    # The parts are those pixels of the whole's, to the bit.
    page.get_by_label("View", exact=True).select_option(label="Depth")
    stage = page.locator(".stage")
    stage.focus()
    stage.press("Shift+ArrowUp")  # 12, 7 of the region
    until(page, "document.querySelector('.values').textContent.startsWith('x 12, y 7')")
    until(page, f"document.querySelector('.values').textContent.includes('{aovs['depth'].values[15, 24, 0]:.4f}')")
    assert not page.get_by_role("button", name="Region…").is_visible()


def test_parts_look_as_the_picture_does(open_page, site):
    """Through the view of the server's PNG, within two steps of eight bits; what is no light is plain sRGB."""
    with site.client() as client:
        aovs = ["emission", "albedo", "C.*<L.>", "depth"]
        job = submit(client, upload(client), wait_s=60, aovs=aovs, denoise=False, resolution=[96, 64])
        shown = {
            stops: client.get(f"/v1/jobs/{job}/preview", params={"exposure": stops, "channel": channel}).content
            for stops, channel in ((0, "rgb"), (1.5, "rgb"))
        }
    expected = {stops: decoded(content) for stops, content in shown.items()}
    page = open_page(f"#/jobs/{job}").page
    until(page, "document.querySelectorAll('.viewer optgroup').length === 2 && document.querySelector('.stage img')")
    part = page.locator(".viewer optgroup").nth(1).locator("option")
    view = page.get_by_label("View", exact=True)
    for name, is_seen in (("Picture", True), ("C.*<L.>", True), ("Albedo", False)):
        before = pictures(page)
        view.select_option(value=part.filter(has_text=re.compile(f"^{re.escape(name)}$")).get_attribute("value"))
        until_pictures(page, before)
        assert ("Shown as in the PNG" in page.locator(".under").inner_text()) is is_seen, name
        if name != "Albedo":
            assert np.abs(canvas(page) - expected[0]).max() <= 2, name
    before = pictures(page)
    view.select_option(value=part.filter(has_text=re.compile("^Picture$")).get_attribute("value"))
    until_pictures(page, before)
    page.get_by_label("Exposure, stops").fill("1.5")
    until_pictures(page, before + 1)
    assert np.abs(canvas(page) - expected[1.5]).max() <= 2
    # The picture itself, drawn without the view: brighter where the view rolls highlights off.
    view.select_option("beauty")
    until(page, "document.querySelector('.sheet > canvas').hidden")
    page.get_by_label("Look").select_option("srgb")
    until(page, "!document.querySelector('.sheet > canvas').hidden")
    assert np.abs(canvas(page) - expected[1.5]).max() > 10


def canvas(page):
    script = """() => {
      const canvas = document.querySelector(".sheet > canvas");
      return [...canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data];
    }"""
    return np.array(page.evaluate(script)).reshape(64, 96, 4)[..., :3]


def decoded(content):
    with tempfile.NamedTemporaryFile(suffix=".png") as file:
        file.write(content)
        file.flush()
        return np.asarray(oiio.ImageBuf(file.name).get_pixels(oiio.UINT8), np.int32)[..., :3]


TWO_PRODUCTS = """
def Scope "Render"
{
    def RenderSettings "settings"
    {
        rel products = [</Render/near>, </Render/side>]
        int2 resolution = (48, 32)
    }
    def RenderProduct "near"
    {
        token productName = "near.exr"
        rel camera = </camera>
        rel orderedVars = [</Render/color>, </Render/prim>]
    }
    def RenderProduct "side"
    {
        token productName = "side.exr"
        rel camera = </side>
        int2 resolution = (24, 24)
        rel orderedVars = [</Render/color>, </Render/prim>]
    }
    def RenderVar "color"
    {
        string sourceName = "color"
    }
    def RenderVar "prim"
    {
        token dataType = "int"
        string sourceName = "prim"
    }
}
"""


def test_each_product_has_its_parts(open_page, site):
    """Those of another camera and resolution too, with the prims that are there."""
    scene = SMALL.replace("    upAxis", '    renderSettingsPrimPath = "/Render/settings"\n    upAxis') + TWO_PRODUCTS
    with site.client() as client:
        job = submit(client, upload(client, scene), wait_s=60, products=["*"], resolution=None)
        names = [each["name"] for each in client.get(f"/v1/jobs/{job}/outputs").json()["items"]]
    assert {"near.exr", "side.exr"} <= set(names)
    page = open_page(f"#/jobs/{job}").page
    until(page, "document.querySelectorAll('.viewer optgroup').length === 3 && document.querySelector('.stage img')")
    assert page.locator(".viewer optgroup").evaluate_all("groups => groups.map((group) => group.label)") == [
        "As it ended",
        "Parts of near.exr",
        "Parts of side.exr",
    ]
    stage, sizes = page.locator(".stage"), []
    for group in (1, 2):
        option = page.locator(".viewer optgroup").nth(group).locator("option", has_text=re.compile("^Prim$"))
        before = pictures(page)
        page.get_by_label("View", exact=True).select_option(option.get_attribute("value"))
        until_pictures(page, before)
        sizes.append(page.evaluate("[...[document.querySelector('.sheet > canvas')].map((c) => [c.width, c.height])][0]"))
        stage.focus()
        stage.press("Shift+ArrowUp")
        until(page, "document.querySelector('.values').innerText !== ''")
        assert re.search(r" /(ball|floor|post)$", values(page)), values(page)
    assert sizes == [[48, 32], [24, 24]]
