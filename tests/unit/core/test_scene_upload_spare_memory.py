"""Memory given back before a build: less is held, and nothing that was in it is lost."""

from __future__ import annotations

import subprocess
import sys

from tests.sanitized import limits_memory

CODE = """
import re
import numpy as np
from pxr import Usd, UsdGeom, UsdShade, UsdSkel
from primray.core.scene_upload import give_back

def held(kind):
    return int(re.search(kind + r":\\s+(\\d+) kB", open("/proc/self/status").read())[1])

stage = Usd.Stage.CreateInMemory()
UsdGeom.Sphere.Define(stage, "/a")
text = stage.ExportToString()
kept = [np.full(1000, i) for i in range(100)]
some = [bytes(1000) for _ in range(30_000)]
top = bytes(1000)
before = held("RssFile"), held("RssAnon")
del some
give_back()
assert held("RssFile") < 0.7 * before[0], (before, held("RssFile"))
assert held("RssAnon") < before[1] - 20_000, (before, held("RssAnon"))
assert stage.ExportToString() == text
assert all((values == i).all() for i, values in enumerate(kept))
UsdShade.Material.Define(stage, "/m")
give_back()
"""


@limits_memory
def test_pages_go_and_come_again() -> None:
    subprocess.run([sys.executable, "-c", CODE], check=True)
