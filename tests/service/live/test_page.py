"""The page of `primray view`: it shows a picture that refines, and follows mouse, keys, choices and files."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from tests.service.live.conftest import FLOOR, GREEN, STAGE, mean_color, number, until_finished, until_phase
from tests.service.page.conftest import until
from tests.service.page.test_axe import check

import primray
from primray.images.reading import read_image


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


def point(page, x, y):
    box = page.locator(".stage canvas").bounding_box()
    return box["x"] + x * box["width"], box["y"] + y * box["height"]


def select_box(page):
    """Click the box in the middle of the picture, and wait until it is named."""
    page.mouse.click(*point(page, 0.5, 0.5))
    until(page, "document.getElementById('selected').innerText.includes('/world/box')")


def test_a_click_names_what_is_there_and_f_frames_it(look):
    page, _ = look()
    until_finished(page)
    assert "click something" in page.locator("#selected").inner_text()
    before, first = number(page), pixels(page)
    select_box(page)
    assert "away" in page.locator("#selected").inner_text()
    assert number(page) == before  # nothing is rendered for that
    page.get_by_role("button", name="Frame selected f").click()
    until_finished(page, before)
    assert difference(first, pixels(page)) > 3
    select_box(page)
    page.keyboard.press("Escape")
    until(page, "document.getElementById('selected').innerText.includes('click something')")
    assert page.get_by_role("button", name="Frame all f").is_visible()


def test_a_click_with_ctrl_explains_the_pixel(look):
    """Parts by light, kind, bounce and sender; the next click cancels or removes them, and a new view makes them old."""
    page, _ = look()
    until_finished(page)
    before = number(page)
    page.mouse.move(*point(page, 0.5, 0.95))
    page.keyboard.down("Control")
    page.mouse.click(*point(page, 0.5, 0.95))
    page.keyboard.up("Control")
    until(page, "document.querySelector('#explained').dataset.phase === 'explained'")
    assert number(page) == before  # the picture stays
    assert "/floor" in page.locator("#selected").inner_text()
    tables = page.locator("#explained table")
    captions = ["by light", "by kind of path", "by bounce", "by the prim that sends it here"]
    assert tables.locator("caption").all_inner_texts() == captions
    assert tables.nth(0).get_by_role("row").all_inner_texts() == ["100.0 ± 0.0 %\t/sky"] or "/sky" in tables.nth(0).inner_text()
    assert "/sky" in tables.nth(3).inner_text()
    assert "±" in tables.nth(3).inner_text()
    assert "Pixel 96 121" in page.locator("#explained").inner_text()
    check(page, files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8"), "explained")
    drag(page, 60, 0)
    until_finished(page, before)
    until(page, "document.querySelector('#explained').innerText.includes('the picture has changed since')")
    select_box(page)
    until(page, "document.querySelector('#explained').innerText === ''")
    assert not page.get_by_role("region", name="Explained pixel").is_visible()


def test_lights_are_mixed_after_the_render(look, tmp_path):
    """A light goes off by its slider, with the error of that and the command which does the same to the saved picture."""
    page, _ = look()
    until_finished(page)
    before, shown = number(page), pixels(page)
    page.get_by_label("Mix of lights", exact=True).check()
    until_finished(page, before)
    assert difference(shown, pixels(page)) == 0
    before = number(page)
    page.get_by_label("Intensity of sky, stops").fill("-1")
    until(page, f"Number(document.querySelector('.stage').dataset.pictures) > {before}")
    until(page, "document.querySelector('.mix').innerText.includes('of the mix')")
    assert pixels(page).mean() < 0.95 * shown.mean()
    assert page.locator(".mix-command").inner_text() == 'primray relight PICTURE.exr --mix "sky=0.5,0.5,0.5"'
    with page.expect_download() as download:
        page.get_by_role("button", name="Save EXR").click()
    download.value.save_as(tmp_path / "saved.exr")
    again = primray.relight(tmp_path / "saved.exr", {"sky": 0.5}).to_uint8()
    assert np.abs(pixels(page).reshape(again.shape) - again).max() <= 1
    page.get_by_role("button", name="Reset lights").click()
    until(page, "!document.querySelector('.mix').innerText.includes('of the mix')")


def test_a_drag_turns_about_what_is_under_the_mouse(look):
    """The corner of the box that the mouse holds stays where it is on the picture."""
    page, _ = look("--camera", "/above")
    until_finished(page)
    x, y = point(page, 0.6, 0.5)
    before = number(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 90, y, steps=6)
    page.mouse.up()
    until_finished(page, before)
    page.mouse.click(x, y)
    until(page, "document.getElementById('selected').innerText.includes('/world/box')")
    steps = page.evaluate("performance.getEntriesByName('step').map((e) => e.duration)")
    assert steps
    assert all(0 < step < 60_000 for step in steps)
    assert "s a step" in page.locator("#speed").inner_text()


def test_flying_and_looking_around(look):
    page, _ = look()
    until_finished(page)
    for keys in ("w", "a", "e"):
        before, last = number(page), pixels(page)
        page.locator(".stage").focus()
        page.keyboard.down(keys)
        page.wait_for_timeout(300)
        page.keyboard.up(keys)
        until_finished(page, before)
        assert difference(last, pixels(page)) > 1
    before, last = number(page), pixels(page)
    page.keyboard.down("Alt")
    drag(page, 60, 20)
    page.keyboard.up("Alt")
    until_finished(page, before)
    assert difference(last, pixels(page)) > 1


def test_other_outputs_and_views_are_shown(look):
    page, _ = look()
    until_finished(page)
    picture, before = pixels(page), number(page)
    page.get_by_label("Output").select_option("normal")
    until_finished(page, before)
    assert difference(picture, pixels(page)) > 10
    before = number(page)
    drag(page, 60, 0)  # while it is shown
    until_finished(page, before)
    before = number(page)
    page.get_by_label("Output").select_option("")
    until_finished(page, before)
    before, shown = number(page), pixels(page)
    views = page.get_by_label("View transform").locator("option").all_inner_texts()
    page.get_by_label("View transform").select_option(views[-1])
    until(page, f"Number(document.querySelector('.stage').dataset.pictures) > {before}")
    assert difference(shown, pixels(page)) > 1


def test_a_denoised_preview(look):
    pytest.importorskip("pyoidn", reason="skipped: no denoiser")
    page, _ = look("--spp", "8")
    until_finished(page)
    before, noisy = number(page), pixels(page)
    page.get_by_label("Denoised preview").check()
    until_finished(page, before)
    assert 0 < difference(noisy, pixels(page)) < 20
    assert page.get_by_label("Denoised preview").is_checked()


def test_light_and_background_are_chosen(look):
    page, _ = look()
    until_finished(page)
    before = number(page)
    page.get_by_text("Light and background").click()
    page.get_by_label("Background", exact=True).select_option("color")
    page.get_by_label("Colour of the background").fill("#ff0000")
    until_finished(page, before)
    until(page, "document.querySelector('.stage canvas').getContext('2d').getImageData(0, 0, 1, 1).data[0] === 255")
    before, last = number(page), pixels(page)
    page.get_by_label("Studio light").select_option("on")
    until_finished(page, before)
    assert difference(last, pixels(page)) > 1
    page.get_by_label("Dome, a lat-long image").fill("/no/such.exr")
    page.get_by_label("Dome, a lat-long image").press("Enter")
    until_phase(page, "failed")
    assert "asset-missing" in page.locator("#problem").inner_text()
    before = number(page)
    page.get_by_label("Dome, a lat-long image").fill("")
    page.get_by_label("Dome, a lat-long image").press("Enter")
    until_finished(page, before)
    assert page.locator("#problem").inner_text() == ""


MOVING = STAGE.replace("double size = 2", "double size.timeSamples = {1: 1, 24: 3}")


def test_a_frame_slider_where_something_moves(look, tmp_path):
    page, _ = look()
    until_finished(page)
    assert not page.get_by_label("Frame", exact=True).is_visible()
    (tmp_path / "moving.usda").write_text(MOVING)
    (tmp_path / "floor.usda").write_text(FLOOR % GREEN)
    page, _ = look(stage=tmp_path / "moving.usda")
    until_finished(page)
    slider = page.get_by_label("Frame", exact=True)
    assert (slider.get_attribute("min"), slider.get_attribute("max")) == ("1", "24")
    shown = []
    for frame in ("24", "1"):
        before = number(page)
        slider.fill(frame)
        until_finished(page, before)
        shown.append(pixels(page))
    assert difference(*shown) > 3


def test_frames_play_and_rest(look, tmp_path):
    """Each picture is of a later frame, the first one after the last; a pause leaves the frame that is shown."""
    (tmp_path / "moving.usda").write_text(MOVING.replace("upAxis", "timeCodesPerSecond = 100\n    upAxis"))
    (tmp_path / "floor.usda").write_text(FLOOR % GREEN)
    page, _ = look(stage=tmp_path / "moving.usda")
    until_finished(page)
    page.evaluate(
        """() => {
          window.played = [];
          const output = document.querySelector('.exposure output');
          const note = () => window.played.push(Number(output.innerText));
          new MutationObserver(note).observe(output, {childList: true, characterData: true, subtree: true});
        }"""
    )
    before = number(page)
    page.get_by_role("button", name="Play").click()
    until(page, "window.played.length > 12 && window.played.some((frame, k) => k > 0 && frame < window.played[k - 1])")
    page.keyboard.press("p")
    until(page, "document.querySelector('[aria-pressed]')?.innerText.startsWith('Play')")
    until_finished(page, before)
    played = page.evaluate("window.played")
    assert set(played) <= set(range(1, 25))
    assert all(a != b for a, b in itertools.pairwise(played))
    rested = page.get_by_label("Frame", exact=True).input_value()
    assert rested == str(played[-1])
    last = pixels(page)
    before = number(page)
    page.get_by_label("Frame", exact=True).fill("24" if int(rested) < 12 else "1")
    until_finished(page, before)
    assert difference(last, pixels(page)) > 1


def test_what_is_taken_away_renders_the_same_picture(look, tmp_path):
    page, running = look("--spp", "8")
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    until_finished(page)
    before = number(page)
    drag(page, 80, 20)
    until_finished(page, before)
    with page.expect_download() as download:
        page.get_by_role("button", name="Save EXR").click()
    assert download.value.suggested_filename == "shot.exr"
    download.value.save_as(tmp_path / "saved.exr")
    page.get_by_role("button", name="Copy camera as USD").click()
    until(page, "document.querySelector('.copied').innerText.includes('The camera is copied')")
    assert 'def Camera "primray_view"' in page.evaluate("navigator.clipboard.readText()")
    page.get_by_role("button", name="Copy command").click()
    until(page, "document.querySelector('.copied').innerText.includes('The command is copied')")
    command = page.evaluate("navigator.clipboard.readText()").replace("--spp 256", "--spp 8")
    folder = Path(sys.executable).parent
    again = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}
    subprocess.run(["bash", "-ec", command], cwd=running.folder, env=again, check=True, timeout=120, capture_output=True)
    saved, made = (read_image(path) for path in (tmp_path / "saved.exr", running.folder / "shot.exr"))
    assert np.array_equal(saved.pixels, made.pixels)


def test_keyboard_and_screen_reader(look):
    """Everything is reached by Tab, has a name, and what changes is said."""
    page, _ = look()
    until_finished(page)
    page.get_by_text("Light and background").click()
    check(page, files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8"), "view")
    names = set()
    page.locator("body").press("Tab")
    for _ in range(40):
        names.add(
            page.evaluate("document.activeElement.labels?.[0]?.innerText || document.activeElement.innerText || ''").strip()
        )
        page.keyboard.press("Tab")
    for name in ("Camera", "Output", "Exposure, stops", "Copy command", "Studio light"):
        assert name in names, names
    page.mouse.click(*point(page, 0.5, 0.5))
    until(page, "document.getElementById('say').innerText.includes('Selected /world/box')")
