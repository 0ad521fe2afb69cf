"""What several tests of translation need."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest


@pytest.fixture
def image(tmp_path: Path) -> str:
    path = tmp_path / "a.png"
    oiio.ImageBuf(np.ones((1, 1, 3), np.float32)).write(str(path), "uint8")
    return str(path)
