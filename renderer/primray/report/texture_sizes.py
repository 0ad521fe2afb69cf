"""How large a description's textures are, from their headers alone: for `primray inspect` and its estimate of memory."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import PurePath

from ..description import SceneDescription
from ..errors import AssetError
from ..textures.image_error import last_error
from .summary import ImageSize, texture_files


def texture_sizes(description: SceneDescription, read: Callable[[str], bytes]) -> dict[str, ImageSize | None]:
    """By path; None for files that cannot be read. `read` gives the bytes of a package's member ("package.usdz[member]")."""
    return {path: _size(path, read) for path in texture_files(description)}


def _size(path: str, read: Callable[[str], bytes]) -> ImageSize | None:
    if not path.endswith("]"):
        return _of_file(path)
    with tempfile.NamedTemporaryFile(suffix=PurePath(path[path.rindex("[") + 1 : -1]).suffix) as unpacked:
        try:
            unpacked.write(read(path))
        except AssetError:
            return None
        unpacked.flush()
        return _of_file(unpacked.name)


def _of_file(path: str) -> ImageSize | None:
    import OpenImageIO as oiio

    image = oiio.ImageInput.open(path)
    if image is None:
        last_error(oiio)
        return None
    spec = image.spec()
    image.close()
    kept = {oiio.UINT8: 1, oiio.UINT16: 2}.get(spec.format.basetype, 4)
    return ImageSize(spec.width, spec.height, spec.nchannels, kept)
