"""Two jobs on top of each other: what is shown and measured is what the half floats say."""

from __future__ import annotations

import time

import numpy as np
import pytest
from tests.service.page.conftest import until
from tests.service.page.scenes import SMALL, submit, upload

from primray_service.worker.preview import decode_preview

PIXELS = """(selector) => {
  const canvas = document.querySelector(selector);
  const copy = new OffscreenCanvas(canvas.width || 1, canvas.height || 1).getContext("2d", { willReadFrequently: true });
  if (canvas.width && canvas.height) copy.drawImage(canvas, 0, 0);
  return [...copy.getImageData(0, 0, copy.canvas.width, copy.canvas.height).data];
}"""


def srgb(linear):
    linear = np.clip(linear, 0, 1)
    return np.round(255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))


def drawn(page, selector, expected, timeout_s=30.0):
    """Until the canvas shows what is expected, within one step of eight bits: drawing follows the sliders after a pause."""
    end = time.monotonic() + timeout_s
    while True:
        pixels = np.array(page.evaluate(PIXELS, selector))
        worst = np.abs(pixels.reshape(32, 48, 4)[..., :3] - expected).max() if pixels.size == 32 * 48 * 4 else np.inf
        if worst <= 1:
            return
        assert time.monotonic() < end, f"{selector} differs by {worst}"
        page.wait_for_timeout(50)


def test_slider_difference_and_values(open_page, site):
    with site.client() as client:
        scene = upload(client)
        first, second = (submit(client, scene, wait_s=60, seed=seed) for seed in (1, 2))
        a, b = (
            decode_preview(client.get(f"/v1/jobs/{job}/preview", params={"format": "raw"}).content).rgb.astype(np.float64)
            for job in (first, second)
        )
    page = open_page(f"#/compare/{first}/{second}").page
    page.locator(".layer img").nth(1).wait_for()
    assert page.locator(".layer img").count() == 2
    # The slider clips B.
    slider = page.get_by_label("Between A and B")
    slider.fill("25")
    assert page.evaluate("document.querySelectorAll('.layer')[1].style.clipPath") == "inset(0px 0px 0px 25%)"
    # A flicker shows one after the other, and keys either of them.
    page.get_by_role("button", name="Flicker").click()
    seen = "[...document.querySelectorAll('.layer')].map((layer) => layer.hidden).join()"
    until(page, f"{seen} === 'true,false'")
    until(page, f"{seen} === 'false,true'")
    page.locator(".stage").press("b")
    assert page.evaluate(seen) == "true,false"
    page.locator(".stage").press(" ")
    assert page.evaluate(seen) == "false,true"
    page.locator(".stage").press("w")
    assert page.evaluate(seen) == "false,false"
    # The measures.
    square = (a - b) ** 2
    numbers = page.locator(".numbers-list").inner_text()
    assert f"{float(np.sqrt(square.mean())):.2g}" in numbers
    assert f"{float((square / (b**2 + 0.01)).mean()):.2g}" in numbers
    # The difference, and both as plain sRGB.
    page.get_by_role("button", name="Difference", exact=True).click()
    page.get_by_label("Gain of the difference").fill("2")
    drawn(page, ".sheet > canvas", srgb(4 * np.abs(a - b)))
    page.get_by_role("button", name="A", exact=True).click()
    page.get_by_label("Look").select_option("srgb")
    page.get_by_label("Exposure, stops").fill("-1")
    drawn(page, ".layer canvas", srgb(a / 2))
    # The values of both under the cursor.
    stage = page.locator(".stage")
    stage.focus()
    stage.press("Shift+ArrowRight")
    text = page.locator(".values").inner_text()
    x, y = 25, 16
    assert f"x {x}, y {y}" in text
    for name, side in (("A", a), ("B", b)):
        assert f"{name} " + "  ".join(f"{c} {v:.4f}" for c, v in zip("RGB", side[y, x], strict=True)) in text
    assert "standard errors apart" in text


def test_a_job_is_no_different_from_itself(open_page, site):
    with site.client() as client:
        scene = upload(client)
        first, second = (submit(client, scene, wait_s=60, seed=3) for _ in range(2))
    page = open_page(f"#/compare/{first}/{second}").page
    page.get_by_text("none: every value is the same").wait_for()
    page.get_by_role("button", name="Swap").click()
    page.wait_for_url(f"**/{second}/{first}")


@pytest.mark.long
def test_other_sizes_are_told(open_page, site):
    with site.client() as client:
        scene = upload(client)
        first = submit(client, scene, wait_s=60)
        second = submit(client, scene, wait_s=60, resolution=[30, 30])
    page = open_page(f"#/compare/{first}").page
    page.get_by_text("Choose two jobs, or").wait_for()
    page.get_by_label("B", exact=True).select_option(second)
    page.get_by_text("The sizes differ (48 × 32 and 30 × 30)").wait_for()
    page.locator(".layer img").nth(1).wait_for()
    assert page.get_by_role("button", name="Difference", exact=True).is_disabled()
    # B keeps its shape: the square stands in the middle of A's 3 to 2.
    page.get_by_label("Look").select_option("srgb")
    page.get_by_role("button", name="B", exact=True).click()
    until(page, "getComputedStyle(document.querySelectorAll('.layer')[1].firstChild).objectFit === 'contain'")


def test_parts_are_compared_with_their_errors(open_page, site):
    """Of two jobs, or of one: any part of their files, amounts in the same colours, ids by the names that they stand for."""
    aovs = ["depth", "albedo", "prim", "crypto_object"]
    with site.client() as client:
        first, second = (submit(client, upload(client, text), wait_s=60, aovs=aovs, seed=seed) for text, seed in VARIED)
    page = open_page(f"#/compare/{first}/{second}?view=Depth").page
    page.locator(".layer canvas").nth(1).wait_for()
    assert page.get_by_label("View", exact=True).input_value() == "Depth"
    numbers = page.locator(".numbers-list")
    assert "Root of the mean square" in numbers.inner_text()
    # The wider ball is nearer, and the rest as far: equal depths have equal colours in both.
    one, two = (np.array(page.evaluate(PIXELS_OF, number)).reshape(32, 48, 4) for number in (0, 1))
    assert (one != two).any()
    assert (one[-2:] == two[-2:]).all()  # the floor
    page.get_by_label("View", exact=True).select_option("Prim")
    page.get_by_text("Pixels that differ").wait_for()
    assert page.url.endswith("?view=Prim")
    page.get_by_role("button", name="Difference", exact=True).click()
    until(page, "/how far A and B are apart/.test(document.querySelector('.legend').textContent)")
    page.get_by_label("View", exact=True).select_option("Crypto object")
    page.get_by_text("Coverage that differs").wait_for()
    # The picture against its own albedo: of one kind; against depth, of another.
    page.get_by_label("View", exact=True).select_option("Picture")
    page.get_by_label("B shows").select_option("Albedo")
    page.get_by_text("relMSE of A against B").wait_for()
    page.get_by_label("B shows").select_option("Depth")
    page.get_by_text("The two are of different kinds").wait_for()
    page.get_by_label("B shows").select_option("the same")
    # By noise alone, few pixels are far apart.
    page.get_by_text("standard errors apart").wait_for()
    page.locator(".stage").press("s")
    until(page, "/chance seldom goes/.test(document.querySelector('.legend').textContent)")
    assert page.locator(".viewer").get_attribute("data-shown") == "deviations"


# Another ball, and a prim before it: numbers of prims are others, names are not.
VARIED = [
    (SMALL, 1),
    (
        SMALL.replace("double radius = 1\n", "double radius = 1.2\n", 1).replace(
            'def Sphere "ball"', 'def Scope "a"\n{\n}\n\ndef Sphere "ball"'
        ),
        2,
    ),
]
PIXELS_OF = """(number) => {
  const canvas = document.querySelectorAll(".layer canvas")[number];
  return [...canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data];
}"""
