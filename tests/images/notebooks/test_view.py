"""A view below a notebook's cell, in JupyterLab and a browser: it refines, is turned, names prims, follows edits, and ends."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.images.notebooks.jupyter import ROOT, Book, Lab, Shown, environment, folder_of_packages, serve

STAGE = """#usda 1.0
(
    upAxis = "Z"
)
def Xform "world"
{
    def Cube "box" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        double size.timeSamples = {1: 2, 24: 4}
        rel material:binding = </world/red>
    }
    def Material "red"
    {
        token outputs:surface.connect = </world/red/surface.outputs:surface>
        def Shader "surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0.8, 0.05, 0.05)
            token outputs:surface
        }
    }
}
def Camera "camera"
{
    float focalLength = 35
    float horizontalAperture = 36
    float verticalAperture = 24
    float2 clippingRange = (0.1, 1000)
    float3 xformOp:rotateXYZ = (75, 0, 20)
    double3 xformOp:translate = (3, -8, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def DomeLight "sky"
{
}
"""
VIEW = 'import primray\n{0} = primray.notebook.View("shot.usda", resolution=(192, 0), spp={1})\n{0}'
COLOR = 'stage.GetPrimAtPath("/world/red/surface").GetAttribute("inputs:diffuseColor")'
BUTTON = f"""import ipywidgets
def turn(b): {COLOR}.Set((0.05, 0.8, 0.05))
b = ipywidgets.Button(description='turn')
b.on_click(turn)
display(b)"""
THREADS = "import threading; print(sorted({t.name for t in threading.enumerate()} & {'viewer', 'files', 'courier'}))"


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    folder: Path = tmp_path_factory.mktemp("notebooks")
    (folder / "shot.usda").write_text(STAGE)
    with serve(folder, tmp_path_factory.mktemp("home")) as served:
        yield served


def middle(shown: Shown) -> np.ndarray:
    """The mean colour of the middle of the picture, 0 to 255."""
    pixels = shown.pixels()
    height, width = pixels.shape[:2]
    mean: np.ndarray = pixels[height // 3 : -height // 3, width // 3 : -width // 3, :3].mean((0, 1))
    return mean


def differ(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape != b.shape or float(np.abs(a.astype(float) - b).mean()) > 0.5


def position(book: Book) -> np.ndarray:
    return np.array(eval(book.ask("print(view.camera.world_from_camera[:3, 3].tolist())")))


def test_a_view_is_turned_named_and_edited(lab: Lab) -> None:
    book = lab.open(VIEW.format("view", 64))
    book.run(0)
    view = book.view()
    view.until_finished()

    # What is finished is the picture, to the bit, with its error.
    red, green, _ = middle(view)
    assert red > 1.5 * green
    assert view.text("numbers").startswith("192 × 128, 64 samples a pixel")
    assert "error (relMSE) 0.0" in view.text("error")
    book.ask("import numpy; numpy.save('shown.npy', view.wait().to_uint8())")
    assert np.array_equal(view.pixels(), np.load(lab.folder / "shown.npy"))

    # A drag turns the camera, which Python reads.
    first, count, before = position(book), view.count, view.pixels()
    view.drag(80, 20)
    view.until_finished(count)
    assert np.linalg.norm(position(book) - first) > 0.5
    assert differ(view.pixels(), before)
    assert "a second" in view.text("speed")

    # The wheel turns it where the view has the focus. Keys of the camera are no keys of the notebook ("a" and "d" are).
    first, count, cells = position(book), view.count, book.cells.count()
    view.root.locator(".stage").focus()
    book.page.mouse.move(*view.point(0.5, 0.5))
    book.page.mouse.wheel(0, -300)
    view.until_finished(count)
    for key in ("a", "d", "d"):
        count = view.count
        book.page.keyboard.press(key, delay=300)
        view.until_finished(count)
    assert book.cells.count() == cells
    assert np.linalg.norm(position(book) - first) > 0.5

    # A click names the prim and its material; what is selected is framed.
    view.root.locator("[data-part=reset]").click()
    view.until_finished(view.count)
    view.page.mouse.click(*view.point(0.5, 0.5))
    view.until("root.querySelector('[data-part=prim]').innerText === '/world/box'")
    assert "material /world/red" in view.text("about")
    assert book.ask("print(view.selected['prim'], view.selected['material'])") == "/world/box /world/red"

    # With Ctrl it explains the pixel.
    view.page.keyboard.down("Control")
    view.page.mouse.click(*view.point(0.5, 0.5))
    view.page.keyboard.up("Control")
    view.until("root.querySelector('[data-part=explained]').dataset.phase === 'explained'")
    assert "by the prim that sends it here" in view.text("explained")
    assert "/sky" in view.text("explained")
    count = view.count
    view.root.get_by_role("button", name="Frame selected").click()
    view.until_finished(count)

    # Lights are mixed after the render, as the call below the sliders does it.
    count = view.count
    view.root.get_by_role("button", name="Lights").click()
    view.until_finished(count)
    view.until("!root.querySelector('[data-part=mix]').hidden")
    count = view.count
    view.root.get_by_label("Intensity of sky, stops").fill("-1")
    view.until_finished(count)
    view.until("root.querySelector('[data-part=mixed]').innerText.includes('of the mix')")
    assert view.text("call") == 'primray.relight(view.image, {"sky": (0.5, 0.5, 0.5)})'
    book.ask(f"numpy.save('mixed.npy', {view.text('call')}.to_uint8())")
    assert np.array_equal(view.pixels(), np.load(lab.folder / "mixed.npy"))
    count = view.count
    view.root.get_by_role("button", name="Lights").click()
    view.until_finished(count)

    # Edits are shown after the cell that makes them, and after a callback.
    count = view.count
    book.ask(f"stage = view.stage\n{COLOR}.Set((0.05, 0.05, 0.8))")
    view.until_finished(count)
    red, _, blue = middle(view)
    assert blue > 1.5 * red
    count = view.count
    book.ask(BUTTON)
    book.cells.last.get_by_role("button", name="turn").click()
    view.until_finished(count)
    red, green, _ = middle(view)
    assert green > 1.5 * red

    # Frames.
    count, before = view.count, view.pixels()
    view.root.get_by_label("Frame", exact=False).last.fill("24")
    view.until_finished(count)
    assert differ(view.pixels(), before)

    # What is wrong is said with its code and place, and the picture stays.
    book.ask("stage.GetPrimAtPath('/camera').SetActive(False); broken = view.stage.GetRootLayer()")
    path = lab.folder / "shot.usda"
    path.write_text(STAGE + "}}\n")
    view.until("root.dataset.phase === 'failed'")
    assert "stage-open: USD cannot read it" in view.text("detail")
    assert "shot.usda" in view.text("where") or "shot.usda" in view.text("detail")
    path.write_text(STAGE)
    view.until("root.dataset.phase === 'finished'")
    assert not view.root.locator("[data-part=problem]").is_visible()


def test_two_views_end_with_their_cells_and_kernel(lab: Lab) -> None:
    book = lab.open(VIEW.format("one", 16), VIEW.format("other", 16))
    book.run(0)
    book.run(1)
    one, other = book.view(0), book.view(1)
    one.until_finished()
    other.until_finished()
    before = other.pixels()
    assert not differ(one.pixels(), before)
    count = one.count
    one.drag(80, 0)
    one.until_finished(count)
    assert differ(one.pixels(), before)
    assert not differ(other.pixels(), before)  # each has a camera of its own
    pid = int(book.ask("import os; print(os.getpid())"))

    # A cell that is deleted takes the threads of its view along, and what was made of the stage.
    assert book.ask("print(one._viewer is not None, one._scene._prepared is not None)") == "True True"
    book.cells.nth(0).locator(".jp-InputPrompt").click()
    book.page.keyboard.press("d")
    book.page.keyboard.press("d")
    for _ in range(60):
        if book.ask("print(one._viewer is None, one._scene._prepared is None)") == "True True":
            break
        time.sleep(0.5)
    else:
        pytest.fail("the view goes on")
    assert book.ask(THREADS) == "['courier', 'files', 'viewer']"  # the other's
    other = book.view(0)
    count = other.count
    other.drag(0, 40)
    other.until_finished(count)

    # So does a kernel that is restarted.
    book.page.get_by_role("menuitem", name="Kernel", exact=True).click()
    book.page.locator(".lm-Menu-itemLabel").filter(has_text="Restart Kernel…").click()
    book.page.locator(".jp-Dialog .jp-mod-accept").click()
    for _ in range(600):
        if not os.path.exists(f"/proc/{pid}"):
            break
        time.sleep(0.1)
    assert not os.path.exists(f"/proc/{pid}")
    book.run(0)
    again = book.view(0)
    again.until_finished()
    assert not differ(again.pixels(), before)


def test_the_example_runs_where_nobody_looks(tmp_path: Path) -> None:
    """As `jupyter execute` does: a view that no page shows still gives its picture."""
    for name in ("view.ipynb", "shot.usda"):
        shutil.copy(ROOT / "examples" / name, tmp_path)
    command = folder_of_packages().parents[2] / "bin/jupyter-execute"
    words = [str(command), "--kernel_name=primray", "--output=done", "view.ipynb"]
    subprocess.run(words, cwd=tmp_path, env=environment(tmp_path / "home"), check=True, timeout=300)
    cells = json.loads((tmp_path / "done.ipynb").read_text())["cells"]
    assert not [cell for cell in json.loads((tmp_path / "view.ipynb").read_text())["cells"] if cell.get("outputs")]
    shown = [list(output.get("data", {})) for cell in cells for output in cell.get("outputs", ())]
    assert "application/vnd.jupyter.widget-view+json" in shown[0]
    assert sum("image/png" in kinds for kinds in shown) == 2
