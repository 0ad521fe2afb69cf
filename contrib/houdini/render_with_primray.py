"""Script of a shelf tool in Houdini: renders the stage of the selected LOP node at the current frame with primray.

The stage is flattened into a temporary file, since most of its layers are in memory; the picture is in $HIP/render. primray
runs with a Python of its own (docs/usdview.md). This script has not been tried inside of Houdini.
"""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import hou

FOREIGN = ("PYTHONPATH", "PYTHONHOME", "PXR_PLUGINPATH_NAME", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")


def main():
    nodes = [node for node in hou.selectedNodes() if hasattr(node, "stage")]
    program = os.environ.get("PRIMRAY_EXECUTABLE") or shutil.which("primray")
    if len(nodes) != 1 or not program:
        why = "Select one LOP node." if program else "There is no program primray: name it by PRIMRAY_EXECUTABLE."
        hou.ui.displayMessage(why, title="primray", severity=hou.severityType.Error)
        return
    output = Path(hou.text.expandString("$HIP"), "render", f"{nodes[0].name()}.{hou.intFrame():04d}.exr")
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="primray-houdini-") as folder:
        scene = Path(folder, "stage.usdc")
        nodes[0].stage().Flatten().Export(str(scene))
        command = [program, "render", str(scene), "--frames", f"{hou.frame():.12g}", "-o", str(output)]
        environment = {name: value for name, value in os.environ.items() if name not in FOREIGN}
        with hou.InterruptableOperation("Rendering with primray", open_interrupt_dialog=True):
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    said = f"{output}\n{done.stderr.strip()}" if done.returncode == 0 else f"primray ended with {done.returncode}."
    severity = hou.severityType.Message if done.returncode == 0 else hou.severityType.Error
    hou.ui.displayMessage(said, title="primray", severity=severity, details=done.stderr)


main()
