"""The process that turns previews into pictures: `python -m primray_service.pictures.process`, used over pipes.

A request is a line of JSON: {"path", and PictureRequest's members}, or {"table": [SPACE, VIEW, DISPLAY, LOOK]} for a view. An
answer is a line of JSON, {"bytes", "media_type", "headers"} or {"error"}, followed by that many bytes. The process ends when
its standard input does, however its server died.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from primray.errors import SettingsError

from ..worker.preview import BadPreview, Preview, read_preview
from .request import MEDIA_TYPES, PictureRequest
from .views import picture, png, view_table

JPEG_QUALITY = 90


def main() -> None:
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    for line in sys.stdin.buffer:
        try:
            head, data = answer(json.loads(line))
        except (BadPreview, OSError, SettingsError) as error:
            head, data = {"error": str(error) or type(error).__name__, "bytes": 0}, b""
        answers.write(json.dumps(head).encode() + b"\n" + data)
        answers.flush()


def answer(asked: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
    if "table" in asked:
        data = view_table(*asked["table"])
        return {"bytes": len(data), "media_type": MEDIA_TYPES["raw"], "headers": {}}, data
    request = PictureRequest(**{name: value for name, value in asked.items() if name != "path"})
    preview = read_preview(Path(asked["path"]))
    values, headers = picture(preview, request)
    data = jpeg(values) if request.format == "jpeg" else png(values)
    headers |= facts(preview)
    return {"bytes": len(data), "media_type": MEDIA_TYPES[request.format], "headers": headers}, data


def facts(preview: Preview) -> dict[str, str]:
    """Return facts about the picture, for headers."""
    width, height = preview.picture
    return {
        "preview-pass": str(preview.passes),
        "preview-samples": str(preview.samples),
        "preview-resolution": f"{width}x{height}",
    }


def jpeg(values: Any) -> bytes:
    import OpenImageIO as oiio

    height, width, channels = values.shape
    kept = 1 if channels == 1 else 3  # JPEG has no alpha; the background is black
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "preview.jpg"))
        spec = oiio.ImageSpec(width, height, kept, "uint8")
        spec.attribute("Compression", f"jpeg:{JPEG_QUALITY}")
        if channels == 4:
            values = (values[..., :3] * (values[..., 3:] / 255.0) + 0.5).astype("uint8")
        file = oiio.ImageOutput.create(path)
        if file is None or not file.open(path, spec) or not file.write_image(values) or not file.close():
            raise OSError("the JPEG could not be written")
        return Path(path).read_bytes()


if __name__ == "__main__":
    main()
