"""contrib/usdview: the plug-in as USD's plug-in registry loads it, and what it renders of what a viewport shows.

usd-core has no Usdviewq: its classes have stand-ins here, with the methods that OpenUSD's pxr/usdImaging/usdviewq documents.
The folder that PRIMRAY_USDVIEWQ names, with `plugin.py` of an OpenUSD, takes the place of the stand-in for the menu.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

import primray

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "contrib/usdview/primrayUsdview"
SHOT = """#usda 1.0
(
    defaultPrim = "World"
)
def Xform "World"
{
    def Sphere "ball" (
        variants = {
            string look = "red"
        }
        prepend variantSets = "look"
    )
    {
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (1.5, 0, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
        variantSet "look" = {
            "red" {
                color3f[] primvars:displayColor = [(1, 0, 0)]
            }
            "blue" {
                color3f[] primvars:displayColor = [(0, 0, 1)]
            }
        }
    }
    def Camera "cam"
    {
        double3 xformOp:translate = (0, 0, 20)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


@pytest.fixture(scope="module")
def rendering() -> ModuleType:
    """The module without its package, which needs usdview."""
    spec = importlib.util.spec_from_file_location("primray_usdview_rendering", PLUGIN / "rendering.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def camera_at(x: float, z: float) -> Gf.Camera:
    return Gf.Camera(
        transform=Gf.Matrix4d().SetTranslate((x, 0, z)), horizontalAperture=20, verticalAperture=15, focalLength=50
    )


@dataclass
class Api:
    """What the plug-in asks of a UsdviewApi."""

    stage: Usd.Stage
    frame: Usd.TimeCode = field(default_factory=lambda: Usd.TimeCode(1))
    cameraPrim: Usd.Prim | None = None
    currentGfCamera: Gf.Camera = field(default_factory=lambda: camera_at(0, 20))
    viewportSize: tuple[int, int] = (48, 36)
    shown: dict[str, bool] = field(default_factory=dict)

    @property
    def dataModel(self) -> Any:
        settings = {f"display{name}": self.shown.get(name, False) for name in ("Render", "Proxy", "Guide")}
        return SimpleNamespace(viewSettings=SimpleNamespace(**settings))


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    (tmp_path / "shot.usda").write_text(SHOT)
    return Usd.Stage.Open(str(tmp_path / "shot.usda"))


def rendered(rendering: ModuleType, api: Api, folder: Path) -> tuple[np.ndarray, Any]:
    """Return the picture of a process, and the files that it was rendered from."""
    folder.mkdir()
    written = rendering.write_view(api, str(folder))
    process = rendering.start(rendering.render_command(api, written, folder / "p.exr", 4), folder / "log")
    assert process.wait() == 0, (folder / "log").read_text()
    buffer = oiio.ImageBuf(str(folder / "p.exr"))
    return np.asarray(buffer.get_pixels(oiio.FLOAT))[..., :4], written


@pytest.fixture(autouse=True)
def program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PRIMRAY_EXECUTABLE", str(Path(sys.executable).with_name("primray")))


def test_the_free_camera_is_rendered_from_the_stages_own_file(rendering: ModuleType, stage: Usd.Stage, tmp_path: Path) -> None:
    before = (tmp_path / "shot.usda").read_text()
    pixels, written = rendered(rendering, Api(stage), tmp_path / "a")
    assert (written.scene, written.notes) == (str(tmp_path / "shot.usda"), ())
    matrix = np.eye(4)
    matrix[2, 3] = 20
    fields: dict[str, Any] = {"resolution": (48, 36), "spp": 4, "time_code": 1.0, "purposes": ("default",)}
    session = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    session.SetEditTarget(session.GetSessionLayer())
    UsdGeom.Camera.Define(session, "/here").SetFromCamera(camera_at(0, 20), 1)
    np.testing.assert_array_equal(pixels, primray.render(session, camera="/here", **fields).pixels)
    moved, _ = rendered(rendering, Api(stage, currentGfCamera=camera_at(2, 20)), tmp_path / "b")
    assert center(moved)[0] < center(pixels)[0] - 3
    later, _ = rendered(rendering, Api(stage, frame=Usd.TimeCode(2)), tmp_path / "c")
    assert center(later)[0] > center(pixels)[0] + 3
    assert (tmp_path / "shot.usda").read_text() == before
    assert not stage.GetPrimAtPath(rendering.CAMERA)


def center(pixels: np.ndarray) -> Any:
    """Return column and row of the centre of what is covered."""
    rows, columns = np.nonzero(pixels[..., 3] > 0.5)
    return columns.mean(), rows.mean()


def is_blue(pixels: np.ndarray) -> bool:
    return bool(pixels[..., 2].sum() > 3 * pixels[..., 0].sum())


def test_edits_that_are_not_saved(rendering: ModuleType, stage: Usd.Stage, tmp_path: Path) -> None:
    assert not is_blue(rendered(rendering, Api(stage), tmp_path / "a")[0])
    stage.GetPrimAtPath("/World/ball").GetVariantSet("look").SetVariantSelection("blue")  # in the root layer
    pixels, written = rendered(rendering, Api(stage), tmp_path / "b")
    assert is_blue(pixels)
    assert "not saved" in written.notes[0]
    assert (tmp_path / "shot.usda").read_text() == SHOT
    stage.Reload()
    stage.SetEditTarget(stage.GetSessionLayer())  # as usdview's own menus do
    stage.GetPrimAtPath("/World/ball").GetVariantSet("look").SetVariantSelection("blue")
    pixels, written = rendered(rendering, Api(stage), tmp_path / "c")
    assert is_blue(pixels)
    assert written.notes == ()


@pytest.mark.parametrize("edit", ["muted", "unloaded", "in memory"])
def test_what_no_file_says_is_flattened(edit: str, rendering: ModuleType, stage: Usd.Stage, tmp_path: Path) -> None:
    if edit == "muted":
        stage.MuteLayer("./none.usda")
    elif edit == "unloaded":
        stage.SetLoadRules(Usd.StageLoadRules.LoadNone())
    else:
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.TransferContent(stage.GetRootLayer())
        stage = Usd.Stage.Open(layer)
    (tmp_path / "a").mkdir()
    written = rendering.write_view(Api(stage), str(tmp_path / "a"))
    assert Path(written.scene).name == "stage.usdc"
    assert Usd.Stage.Open(written.scene).GetPrimAtPath("/World/ball")
    assert len(written.notes) == 1


def test_the_command_takes_the_viewport_over(rendering: ModuleType, stage: Usd.Stage, tmp_path: Path) -> None:
    camera = stage.GetPrimAtPath("/World/cam")
    api = Api(stage, Usd.TimeCode(1.5), camera, viewportSize=(64, 32), shown={"Proxy": True, "Guide": True})
    written = rendering.write_view(api, str(tmp_path))
    command = rendering.render_command(api, written, tmp_path / "p.png")
    given = dict(pairwise(command))
    assert (given["--camera"], given["--frames"], given["--purposes"]) == ("/World/cam", "1.5", "default,proxy,guide")
    assert command[command.index("--res") + 1 :][:2] == ["64", "32"]
    still = rendering.render_command(Api(stage, Usd.TimeCode.Default()), written, tmp_path / "p.png")
    assert "--frames" not in still


def test_the_process_has_a_python_of_its_own(rendering: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in rendering.FOREIGN[:3]:
        monkeypatch.setenv(name, "/usdview")
    code = "import json, os; print(json.dumps(dict(os.environ)))"
    assert rendering.start([sys.executable, "-c", code], tmp_path / "log").wait() == 0
    assert not set(rendering.FOREIGN) & set(json.loads((tmp_path / "log").read_text()))
    monkeypatch.delenv("PRIMRAY_EXECUTABLE")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RuntimeError, match="no program primray"):
        rendering.executable()


STAND_IN = """
import sys, types
from pxr import Plug, Tf
import pxr

class PluginContainer:
    def registerPlugins(self, plugRegistry, plugCtx):
        raise NotImplementedError

found = types.ModuleType("pxr.Usdviewq"); found.__path__ = []
plugin = types.ModuleType("pxr.Usdviewq.plugin"); plugin.PluginContainer = PluginContainer
PluginContainer.__module__ = plugin.__name__
kind = Tf.Type.Define(PluginContainer)
sys.modules |= {found.__name__: found, plugin.__name__: plugin}
"""
LOADED = """
class Registry:
    def registerCommandPlugin(self, name, displayName, callback, description=""):
        return types.SimpleNamespace(name=name, displayName=displayName, callback=callback)

class Menus:
    def findOrCreateMenu(self, name):
        print("menu", name)
        return types.SimpleNamespace(addItem=lambda command, shortcut=None: print("item", command.displayName))

(container,) = Plug.Registry.GetAllDerivedTypes(kind)
assert Plug.Registry().GetPluginForType(container).Load()
made = container.pythonClass()
made.registerPlugins(Registry(), None)
made.configureView(Registry(), Menus())
"""


def environment() -> dict[str, str]:
    return os.environ | {"PXR_PLUGINPATH_NAME": str(PLUGIN), "PYTHONPATH": str(PLUGIN.parent)}


def test_usds_registry_finds_and_loads_the_plugin() -> None:
    done = subprocess.run(
        [sys.executable, "-c", STAND_IN + LOADED], env=environment(), capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines() == ["menu primray", "item Render with primray"], done.stderr


WINDOW = """
import importlib, importlib.machinery, os, sys, time, types
found = types.ModuleType("pxr.Usdviewq")
found.__path__ = [os.environ["PRIMRAY_USDVIEWQ"]]
qt = types.ModuleType("pxr.Usdviewq.qt")
from PySide6 import QtCore, QtGui, QtWidgets
qt.QtCore, qt.QtGui, qt.QtWidgets = QtCore, QtGui, QtWidgets
sys.modules |= {found.__name__: found, qt.__name__: qt}
plugin = importlib.import_module("pxr.Usdviewq.plugin")
from pxr import Usd, Gf
app = QtWidgets.QApplication([])
main = QtWidgets.QMainWindow()
stage = Usd.Stage.Open(sys.argv[1])
settings = types.SimpleNamespace(displayRender=True, displayProxy=False, displayGuide=False)
api = types.SimpleNamespace(stage=stage, frame=Usd.TimeCode(1), cameraPrim=stage.GetPrimAtPath("/World/cam"),
    currentGfCamera=Gf.Camera(), viewportSize=(64, 48), qMainWindow=main,
    dataModel=types.SimpleNamespace(viewSettings=settings))
assert plugin.loadPlugins(api, main) is not None
(menu,) = [each for each in main.menuBar().actions() if each.text() == "primray"]
(action,) = menu.menu().actions()
action.trigger()
(window,) = [each for each in app.topLevelWidgets() if each.windowTitle() == "primray"]
end = time.monotonic() + 120
while window.button.text() != "Close" and time.monotonic() < end:
    app.processEvents()
    time.sleep(0.05)
picture = window.picture.pixmap()
print(picture.width(), picture.height(), window._folder.exists())
folder = window._folder
window.close()
print(folder.exists())
action.trigger()
(again,) = [each for each in app.topLevelWidgets() if each.windowTitle() == "primray" and each.isVisible()]
again.close()
print(again._process.poll() is not None)
os._exit(0)
"""


def test_the_menu_of_an_openusd_renders_into_a_window(stage: Usd.Stage) -> None:
    if "PRIMRAY_USDVIEWQ" not in os.environ or importlib.util.find_spec("PySide6") is None:
        pytest.skip("skipped: no PRIMRAY_USDVIEWQ, or no PySide6")
    command = [sys.executable, "-c", WINDOW, stage.GetRootLayer().realPath]
    path = f"{PLUGIN.parent}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    done = subprocess.run(
        command,
        env=environment() | {"QT_QPA_PLATFORM": "offscreen", "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.splitlines() == ["64 48 True", "False", "True"], done.stderr
