"""From what usdview shows to a command line of primray; no Qt, no window.

A stage without unsaved edits is rendered from its own file, with a session layer that holds the free camera and what the user
changed in usdview (variants, visibility). Unsaved edits, muted layers and payloads that are not loaded are in no file: then the
stage is flattened into one, as usdview composes it.
"""

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

CAMERA = "/primray_usdview_camera"
EXECUTABLE = "PRIMRAY_EXECUTABLE"
# usdview's own Python and USD, which would take the place of those of primray.
FOREIGN = ("PYTHONPATH", "PYTHONHOME", "PXR_PLUGINPATH_NAME", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")


@dataclass(frozen=True)
class Written:
    """Files of a view in a folder; `notes` are for the user."""

    scene: str
    session: str
    camera: str
    notes: tuple


def write_view(usdviewApi, folder):
    """Write what the viewport shows so that another process can render it."""
    stage, notes = usdviewApi.stage, []
    session = Sdf.Layer.CreateNew(str(Path(folder, "session.usda")))
    scene = stage.GetRootLayer().realPath
    if why := _not_in_files(stage):
        scene = str(Path(folder, "stage.usdc"))
        stage.Flatten().Export(scene)
        notes.append(f"The stage is rendered from a flattened copy: {why}.")
    else:
        # The session layer may name files by paths from the root layer's folder.
        session.TransferContent(stage.GetSessionLayer())
    camera = usdviewApi.cameraPrim
    if camera:
        path = str(camera.GetPath())
    else:
        path = CAMERA
        own = Usd.Stage.Open(session)
        UsdGeom.Camera.Define(own, CAMERA).SetFromCamera(usdviewApi.currentGfCamera, usdviewApi.frame)
    session.Save()
    return Written(scene, str(session.realPath), path, tuple(notes))


def _not_in_files(stage):
    """Return why the stage's own files are not what usdview shows; "" where they are."""
    root = stage.GetRootLayer()
    if not root.realPath:
        return "it has no file"
    own = stage.GetSessionLayer()
    kept = {own, *(Sdf.Layer.Find(path) for path in own.subLayerPaths)} if own else set()
    unsaved = [layer for layer in stage.GetUsedLayers() if layer not in kept and (layer.dirty or layer.anonymous)]
    if unsaved or (own and own.subLayerPaths):
        return "it has edits that are not saved"
    if stage.GetMutedLayers():
        return "layers are muted"
    if stage.GetLoadRules() != Usd.StageLoadRules.LoadAll() or not stage.GetPopulationMask().IncludesSubtree("/"):
        return "not all of it is loaded"
    return ""


def executable():
    """Return the program primray; RuntimeError where there is none."""
    found = os.environ.get(EXECUTABLE) or shutil.which("primray")
    if not found:
        raise RuntimeError(f"There is no program primray on the PATH. Name it by the variable {EXECUTABLE}.")
    return found


def render_command(usdviewApi, written, output, samples=64):
    """Return the command line that renders the view to `output`, with the frame, size and purposes of the viewport."""
    command = [executable(), "render", written.scene, "--session-layer", written.session, "--camera", written.camera]
    width, height = (max(1, int(size)) for size in usdviewApi.viewportSize)
    command += ["--res", str(width), str(height), "--spp", str(samples), "-o", str(output)]
    settings = usdviewApi.dataModel.viewSettings
    shown = {"render": settings.displayRender, "proxy": settings.displayProxy, "guide": settings.displayGuide}
    command += ["--purposes", ",".join(["default", *(name for name, is_shown in shown.items() if is_shown)])]
    if not usdviewApi.frame.IsDefault():
        command += ["--frames", f"{usdviewApi.frame.GetValue():.12g}"]
    return command


def start(command, log):
    """Start primray with its own Python; what it says goes to the file `log`."""
    environment = {name: value for name, value in os.environ.items() if name not in FOREIGN}
    with open(log, "wb") as to:
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=to, stderr=to, env=environment)
