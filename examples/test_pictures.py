"""In pytest: a shot must look as its reference does, beyond its noise. `pytest --primray-update` writes the reference first.

`primray_image` is a fixture that comes with primray; PRIMRAY_REFERENCES may name another folder than this one.
"""

import os
from pathlib import Path

FOLDER = Path(os.environ.get("PRIMRAY_REFERENCES", Path(__file__).parent / "references"))


def test_shot(primray_image):
    primray_image("shot.usda", reference=FOLDER / "shot.exr", spp=32, resolution=(160, 90), tolerance=0.1)
