"""Display of a picture: under a notebook's cell, or in the desktop's viewer."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import PrimrayError
from ..notices.notebook import display, in_notebook

if TYPE_CHECKING:
    from .image import Image


def show(image: Image) -> None:
    """Show the image; PrimrayError if there is neither a notebook nor a desktop."""
    if in_notebook():
        display(image)
        return
    viewer = _viewer()
    if viewer is None:
        raise PrimrayError("there is no desktop to show a picture on; image.save('picture.png') writes it", code="no-display")
    # The viewer may read the file after this process has ended, so it is left to the system's cleanup of temporary files.
    path = image.save(Path(tempfile.mkdtemp(prefix="primray-"), "picture.png"))
    try:
        subprocess.Popen([viewer, path], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    except OSError as error:
        raise PrimrayError(f"{viewer} cannot be started: {error.strerror}", where=str(path), code="no-display") from error


def _viewer() -> str | None:
    """Return the command that opens a file in the desktop's viewer, or None."""
    if sys.platform == "darwin":
        return shutil.which("open")
    has_desktop = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return shutil.which("xdg-open") if has_desktop else None
