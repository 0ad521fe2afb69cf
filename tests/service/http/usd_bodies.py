"""Bodies that are what their media types say, for schemathesis: others are refused at their first bytes."""

from __future__ import annotations

import io
import zipfile

import schemathesis
from hypothesis import strategies as st

TEXT = """#usda 1.0
(defaultPrim = "w")
def Xform "w"
{{
    def Sphere "s"
    {{
        double radius = {radius}
    }}
}}
"""

usda = st.floats(0.1, 10).map(lambda radius: TEXT.format(radius=radius).encode())


def zipped(layer: bytes) -> bytes:
    """Stored at offset 64, as usdz wants its members."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as package:
        info = zipfile.ZipInfo("root.usda")
        info.extra = b"\x19\x86" + (21).to_bytes(2, "little") + bytes(21)
        package.writestr(info, layer)
    return out.getvalue()


schemathesis.openapi.media_type("model/vnd.usda", usda)
schemathesis.openapi.media_type("model/vnd.usdc", st.binary(max_size=200).map(lambda rest: b"PXR-USDC" + rest))
schemathesis.openapi.media_type("model/vnd.usdz+zip", usda.map(zipped))
schemathesis.openapi.media_type("application/zip", usda.map(zipped))
