"""How large a description's textures are, from their headers alone: for `primray inspect` and its estimate of memory."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import PurePath

from .description import SceneDescription
from .errors import AssetError
from .summary import texture_files

Size = tuple[int, int, int]  # width, height, channels


def texture_sizes(description: SceneDescription, read: Callable[[str], bytes]) -> dict[str, Size | None]:
    """By path; None for files that cannot be read. `read` gives the bytes of a package's member ("package.usdz[member]")."""
    return {path: _size(path, read) for path in texture_files(description)}


def _size(path: str, read: Callable[[str], bytes]) -> Size | None:
    if not path.endswith("]"):
        return _of_file(path)
    with tempfile.NamedTemporaryFile(suffix=PurePath(path[path.rindex("[") + 1 : -1]).suffix) as unpacked:
        try:
            unpacked.write(read(path))
        except AssetError:
            return None
        unpacked.flush()
        return _of_file(unpacked.name)


def _of_file(path: str) -> Size | None:
    import OpenImageIO as oiio

    image = oiio.ImageInput.open(path)
    if image is None:
        oiio.geterror()
        return None
    spec = image.spec()
    image.close()
    return spec.width, spec.height, spec.nchannels
