"""The page of `primray view`: it shows a picture that refines, and follows mouse, keys, choices and files."""

from __future__ import annotations

import numpy as np
from tests.service.live.conftest import FLOOR, GREEN, mean_color, number, until_finished, until_phase
from tests.service.page.conftest import until


def test_the_picture_refines(look):
    page, _ = look("--spp", "4096")  # it must last until the browser is there
    samples = []
    while page.evaluate("document.body.dataset.phase") != "finished":
        seen = page.evaluate("Number(document.body.dataset.samples ?? 0)")
        samples += [seen] if seen and seen not in samples else []
        page.wait_for_timeout(10)
    until_finished(page)
    assert samples == sorted(samples)
    assert samples[0] < 2048
    assert page.evaluate("document.body.dataset.samples") == "4096"
    assert page.locator(".stage canvas").evaluate("(c) => [c.width, c.height]") == [192, 128]
    line = page.locator("#numbers").inner_text()
    assert "192 × 128, 4096 samples a pixel" in line
    assert "error (relMSE) " in line
    assert page.title() == "shot.usda · primray"
    red, _, blue = mean_color(page)
    assert red > 1.5 * blue


def drag(page, across, down, **how):
    box = page.locator(".stage").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down(**how)
    page.mouse.move(x + across, y + down, steps=5)
    page.mouse.up(**how)


def pixels(page):
    return np.array(
        page.locator(".stage canvas").evaluate(
            "(c) => Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data)"
        ),
        float,
    )


def difference(a, b):
    return float(np.abs(a - b).mean()) if a.shape == b.shape else 255.0


def test_dragging_turns_the_camera_and_r_puts_it_back(look):
    page, _ = look()
    until_finished(page)
    first = pixels(page)
    drag(page, 150, 40)
    until(page, "document.querySelector('.right').innerText.includes('moved; its lens is used')")
    until_finished(page, number(page))
    turned = pixels(page)
    assert difference(first, turned) > 3
    before = number(page)
    page.keyboard.press("r")
    until_finished(page, before)
    assert "moved" not in page.locator(".right").inner_text()
    for _ in range(100):  # what was on its way from the move may be finished first
        if difference(first, pixels(page)) == 0:
            break
        page.wait_for_timeout(100)
    assert difference(first, pixels(page)) == 0  # the same samples of the same camera


def test_all_ways_to_move(look):
    page, _ = look()
    until_finished(page)
    last = pixels(page)
    moves = [
        lambda: drag(page, 60, 0, button="middle"),
        lambda: drag(page, 60, 0, button="right"),
        lambda: page.mouse.wheel(0, -300),
        lambda: page.keyboard.press("ArrowLeft"),
        lambda: page.keyboard.press("Shift+ArrowUp"),
        lambda: page.keyboard.press("-"),
        lambda: page.keyboard.press("f"),
    ]
    for make in moves:
        before = number(page)
        make()
        until_finished(page, before)
        now = pixels(page)
        assert difference(last, now) > 1
        last = now


def test_cameras_can_be_chosen(look):
    page, _ = look()
    until_finished(page)
    first, before = pixels(page), number(page)
    assert page.get_by_label("Camera").locator("option").all_inner_texts() == ["/camera", "/above"]
    page.get_by_label("Camera").select_option("/above")
    until_finished(page, before)
    assert difference(first, pixels(page)) > 3
    assert page.get_by_label("Camera").input_value() == "/above"


def test_variants_can_be_chosen(look):
    page, _ = look()
    until_finished(page)
    before = number(page)
    page.get_by_label("paint of /world").select_option("blue")
    until_finished(page, before)
    red, _, blue = mean_color(page)
    assert blue > 1.5 * red
    drag(page, 40, 0)  # the camera is put into the stage that was composed anew
    until_finished(page, number(page))
    red, _, blue = mean_color(page)
    assert blue > 1.5 * red


def test_the_exposure_is_changed_without_rendering(look):
    page, _ = look()
    until_finished(page)
    dark, before = np.mean(mean_color(page)), number(page)
    page.get_by_label("Exposure, stops").fill("2")
    until(page, f"Number(document.querySelector('.stage').dataset.pictures) > {before}")
    assert np.mean(mean_color(page)) > 1.3 * dark
    assert number(page) == before + 1


def test_a_file_that_changes_is_rendered(look):
    page, running = look()
    until_finished(page)
    before, first = number(page), pixels(page)
    (running.folder / "floor.usda").write_text(FLOOR % GREEN)
    until_finished(page, before)
    now = pixels(page).reshape(-1, 4)
    assert difference(first, pixels(page)) > 3
    assert now[-192:, 1].mean() > 1.5 * now[-192:, 0].mean()  # the floor, in front


def test_a_broken_file_is_told_and_the_picture_stays(look):
    page, running = look()
    until_finished(page)
    first = pixels(page)
    (running.folder / "floor.usda").write_text(FLOOR % GREEN + "\n}}\n")
    until_phase(page, "failed")
    told = page.locator("#problem").inner_text()
    assert "floor.usda" in told
    assert "stage-open: USD cannot read it: floor.usda:" in told
    assert difference(first, pixels(page)) == 0
    drag(page, 60, 0)  # it goes on with what was read before
    until(page, "document.querySelector('.right').innerText.includes('moved; its lens is used')")
    assert "floor.usda" in page.locator("#problem").inner_text()
    before = number(page)
    (running.folder / "floor.usda").write_text(FLOOR % GREEN)
    until_finished(page, before)
    assert page.locator("#problem").inner_text() == ""
    now = pixels(page).reshape(-1, 4)
    assert now[-192:, 1].mean() > 1.5 * now[-192:, 0].mean()


def test_a_stage_that_breaks_is_shown_again_once_it_is_mended(look):
    """What is broken at first is refused before it is served, as by other commands (test_app.py)."""
    page, running = look()
    until_finished(page)
    whole = (running.folder / "shot.usda").read_text()
    (running.folder / "shot.usda").write_text("#usda 1.0\ndef {{\n")
    until_phase(page, "failed")
    assert "USD cannot read it: shot.usda:2" in page.locator("#problem").inner_text()
    before = number(page)
    (running.folder / "shot.usda").write_text(whole)
    until_finished(page, before)
    assert page.locator("#problem").inner_text() == ""


def test_a_file_that_was_missing_comes(look):
    page, running = look()
    until_finished(page)
    (running.folder / "floor.usda").unlink()
    until_phase(page, "failed")
    assert "There is no such file" in page.locator("#problem").inner_text()
    before = number(page)
    (running.folder / "floor.usda").write_text(FLOOR % GREEN)
    until_finished(page, before)


def test_what_the_stage_does_not_say_is_told(look):
    page, running = look()
    until_finished(page)
    before = number(page)
    (running.folder / "floor.usda").write_text('#usda 1.0\ndef Volume "patch" {}\n')
    until_finished(page, before)
    assert "/patch" in page.locator(".diagnostics").inner_text()


def test_it_says_when_the_viewer_has_ended(look):
    page, running = look()
    until_finished(page)
    running.process.terminate()
    running.process.wait(20)
    until(page, "document.getElementById('server').textContent.includes('has ended')")
    page.context.close()
    [watched] = look.opened
    assert all("net::ERR_" in line for line in watched.wrong)
    watched.wrong.clear()
