"""Takes docs/service/page.jpg, the picture of the page in README: `python -m tests.service.docs.page_picture [SECONDS]`.

A server of its own renders candles for so many seconds of sampling (default 240); the job is then looked at as a visitor
does: its picture with the values and the prim under the pointer, its histogram, its error, its files.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import httpx2
from playwright.sync_api import ViewportSize, sync_playwright
from tests.service.page.conftest import ARGUMENTS, CHROMIUM, until
from tests.service.serving import start

ROOT = Path(__file__).resolve().parents[3]
SCENE = ROOT / "scenes" / "gallery" / "wax"
PICTURE = ROOT / "docs" / "service" / "page.jpg"
SIZE = ViewportSize(width=1400, height=1010)
POINTED_AT = (0.497, 0.69)  # of the picture: the disc of jade
QUALITY = 86
AOVS = ["depth", "normal", "albedo", "prim", "crypto_object", "C<RD>.*", "samples"]


def main(seconds: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        server = start(Path(folder, "data"))
        try:
            with server.client() as client:
                job = rendered(client, seconds)
            look(server.url, job)
        finally:
            server.stop()


def rendered(client: httpx2.Client, seconds: float) -> str:
    """The job's id, once it has ended."""
    package = io.BytesIO()
    with zipfile.ZipFile(package, "w") as file:
        for path in sorted(SCENE.iterdir()):
            if path.suffix != ".py":
                file.write(path, path.name)
    scene = client.post("/v1/scenes", params={"name": "candles.zip"}, content=package.getvalue()).json()
    request = {
        "scene": {"id": scene["id"], "entry": "scene.usda"},
        "name": "candles",
        "labels": {"shot": "010"},
        "settings": {"resolution": [960, 540], "aovs": AOVS, "stop": {"target_error": 1e-3, "max_seconds": seconds}},
    }
    made = client.post("/v1/jobs", json=request)
    made.raise_for_status()
    url = f"/v1/jobs/{made.json()['id']}"
    while (job := client.get(url).json())["state"] not in ("succeeded", "failed", "canceled"):
        print(job["state"], job["progress"], file=sys.stderr)
        time.sleep(5)
    assert job["state"] == "succeeded", job
    return str(job["id"])


def look(url: str, job: str) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS.split())
        page = browser.new_page(viewport=SIZE, color_scheme="light", locale="en-GB")
        page.set_default_timeout(60_000)
        page.goto(f"{url}/#/jobs/{job}")
        until(page, "document.querySelectorAll('.viewer optgroup').length === 2 && document.querySelector('.stage img')")
        page.get_by_text("Histogram", exact=True).click()
        until(page, "document.querySelector('.histogram .note').textContent !== ''")
        image = page.locator(".stage img").bounding_box()
        assert image is not None
        across, down = POINTED_AT
        page.mouse.move(image["x"] + across * image["width"], image["y"] + down * image["height"])
        until(page, "document.querySelector('.values .prim') && /±/.test(document.querySelector('.values').textContent)")
        page.screenshot(path=PICTURE, type="jpeg", quality=QUALITY)
        browser.close()


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 240.0)
