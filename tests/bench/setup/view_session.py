"""A session with `primray view` in a browser: how long each step takes from the hand to the eye.

    python -m tests.bench.setup.view_session STAGE --seconds 60

The mouse is dragged, the wheel turned, the camera flown and pictures left to refine, by turns. A step is the time from the
first event of a command to the picture on the screen that shows it; the page measures it. Also: seconds from the address to
the first picture, and to the whole scene.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page, sync_playwright
from tests.service.page.conftest import ARGUMENTS, CHROMIUM

EVENT_S = 1 / 60
REST_S = 1.5
STEPS = "performance.getEntriesByName('step').map((e) => [e.startTime, e.duration])"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("stage")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--res", type=int, default=960, help="width of the picture")
    parser.add_argument("--screenshots", help="folder for pictures of the page")
    given = parser.parse_args()
    asked = [str(Path(sys.executable).with_name("primray")), "view", given.stage, "--no-open", "--res", str(given.res), "0"]
    process = subprocess.Popen(asked, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        url = process.stdout.readline().split()[-1]
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS.split())
            page = browser.new_page(viewport={"width": 1400, "height": 900})
            found = session(page, url, given.seconds, given.screenshots)
            browser.close()
    finally:
        process.terminate()
        process.wait()
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    found |= {"cpu_s": round(used.ru_utime + used.ru_stime, 1), "peak_mb": used.ru_maxrss // 1024, "load": os.getloadavg()[0]}
    print(json.dumps(found, indent=1))


def session(page: Page, url: str, seconds: float, screenshots: str | None) -> dict[str, object]:
    """Return what was measured."""
    start = time.monotonic()
    phases: list[tuple[float, str]] = []
    page.goto(url)

    def note() -> None:
        words = page.locator("#numbers .phase").inner_text()
        if not phases or phases[-1][1] != words:
            phases.append((round(time.monotonic() - start, 2), words))

    def until(script: str) -> float:
        while not page.evaluate(script):
            note()
            page.wait_for_timeout(10)
        return round(time.monotonic() - start, 2)

    def shoot(name: str) -> None:
        if screenshots:
            page.screenshot(path=f"{screenshots}/{name}.png")

    first_s = until("Number(document.querySelector('.stage').dataset.pictures) > 0")
    shoot("first")
    ready_s = until("['rendering', 'finished'].includes(document.body.dataset.phase)")
    until("Number(document.body.dataset.samples) >= 3")
    shoot("whole")
    actions = acts(page)
    begun, turn, by_action = time.monotonic(), 0, dict[str, list[float]]()
    while time.monotonic() - begun < seconds:
        name, act = actions[turn % len(actions)]
        before = len(page.evaluate(STEPS))
        act()
        page.wait_for_timeout(1000 * REST_S)
        by_action.setdefault(name, []).extend(s / 1000 for _, s in page.evaluate(STEPS)[before:])
        if turn < len(actions):
            shoot(f"{turn:02d}-{name}")
        turn += 1
    steps = sorted(s for each in by_action.values() for s in each)
    return {
        "first_picture_s": first_s,
        "whole_scene_s": ready_s,
        "phases": phases,
        "steps": len(steps),
        "median_s": round(statistics.median(steps), 3),
        "p95_s": round(steps[int(0.95 * (len(steps) - 1))], 3),
        "longest_s": round(steps[-1], 3),
        "longest_by_action": {name: round(max(each, default=math.nan), 3) for name, each in by_action.items()},
        "steps_by_action": {name: len(each) for name, each in by_action.items()},
    }


def acts(page: Page) -> list[tuple[str, Callable[[], None]]]:
    """Return what is done by turns, each for a second or two."""
    box = page.locator(".stage").bounding_box()
    assert box is not None
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(across: float, down: float, **how: object) -> None:
        x, y = middle
        page.mouse.move(x, y)
        page.mouse.down(**how)  # type: ignore[arg-type]
        for i in range(1, 91):
            page.mouse.move(x + across * i / 90, y + down * math.sin(math.pi * i / 90))
            page.wait_for_timeout(1000 * EVENT_S)
        page.mouse.up(**how)  # type: ignore[arg-type]

    def wheel(pixels: float) -> None:
        page.mouse.move(*middle)
        for _ in range(20):
            page.mouse.wheel(0, pixels)
            page.wait_for_timeout(3000 * EVENT_S)

    def fly(key: str) -> None:
        page.locator(".stage").focus()
        page.keyboard.down(key)
        page.wait_for_timeout(1000)
        page.keyboard.up(key)

    def select() -> None:
        page.mouse.click(*middle)

    def press(key: str) -> None:
        page.locator(".stage").focus()
        page.keyboard.press(key)

    return [
        ("turn", lambda: drag(300, 40)),
        ("turn back", lambda: drag(-500, -60)),
        ("nearer", lambda: wheel(-40)),
        ("turn close", lambda: drag(250, 30)),
        ("select", select),
        ("frame", lambda: press("f")),
        ("turn it", lambda: drag(400, -50)),
        ("pan", lambda: drag(120, 40, button="middle")),
        ("fly back", lambda: fly("s")),
        ("farther", lambda: wheel(40)),
        ("deselect", lambda: press("Escape")),
        ("frame all", lambda: press("f")),
        ("turn around", lambda: drag(600, 0)),
        ("reset", lambda: press("r")),
    ]


if __name__ == "__main__":
    main()
