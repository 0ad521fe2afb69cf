"""Thumbnails: rendered once at the largest size by a process of its own, then put into place whole or not at all.

The process is limited in time and memory, since file browsers ask for thumbnails of files that nobody has looked at. It writes
PNGs into a scratch folder; what becomes of them (files beside the asset, a preview that the asset names, the cache of file
browsers) is decided here, after it has ended well.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from ..errors import InternalError, LimitError, PrimrayError, SceneError, SettingsError
from ..read_files import note_output, watching_files
from ..version import __version__

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from ..process_memory import Watch

FOLDER = "thumbs"  # beside the asset
MOST_PIXELS = 4096
NEUTRAL = "#c8c8c8"
MIB = 2**20
_ADDRESSES = 8 * 2**30  # beyond the limit of memory: addresses that threads and files reserve without using them
_SAMPLING_SHARE = 0.5  # of the time limit: what is sampled by then is the picture


@dataclass(frozen=True)
class Request:
    """What the rendering process is asked for."""

    asset: str
    sizes: tuple[int, ...]
    files: tuple[str, ...]  # PNGs to write, one for each size
    places: tuple[str, ...]  # where they are moved to, which must not be files of the asset
    settings: Mapping[str, Any]
    text: Mapping[str, str]  # text chunks of the PNGs
    timeout_s: float
    memory_bytes: int


# The limit of memory comes before any import, so that it holds for these, too.
_MAIN = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({limit}, {limit}))
from primray.cli.thumbnail_renders import main
main(sys.argv[1])
"""


def render_thumbnails(request: Request, scratch: Path) -> str:
    """Render in a process of its own; return what it says about the stage. PrimrayError if there are no pictures."""
    from .sheet_renders import LIMIT_S, run_limited

    order = scratch / "request.json"
    order.write_text(json.dumps(asdict(request)), encoding="utf-8")
    code = _MAIN.format(limit=request.memory_bytes + _ADDRESSES)
    ended = run_limited([sys.executable, "-c", code, str(order)], request.timeout_s, scratch / "stderr")
    if ended.exit_code == LIMIT_S:
        sentence = f"it takes more than the {request.timeout_s:g} s of --timeout"
        raise LimitError(sentence, where=request.asset, code="time-limit")
    if ended.exit_code != 0 or not all(map(os.path.isfile, request.files)):
        raise _error_of(ended.exit_code, ended.stderr, request)
    return ended.stderr


def _error_of(exit_code: int | str, stderr: str, request: Request) -> PrimrayError:
    """Return the error of a process that left no pictures."""
    last = next((line for line in reversed(stderr.splitlines()) if line.startswith("{")), None)
    if last is not None:
        told = json.loads(last)
        error = PrimrayError(told["message"], where=told["where"], code=told["code"])
        error.exit_code = told["exit_code"]
        return error
    if exit_code == LimitError.exit_code or "MemoryError" in stderr or "bad_alloc" in stderr:  # process_memory ended it
        return _too_large(request)
    said = (stderr.strip().splitlines() or ["without a message"])[-1]
    return InternalError(f"its process ended with {exit_code}: {said}", where=request.asset)


def _too_large(request: Request) -> LimitError:
    sentence = f"it takes more than the {request.memory_bytes / MIB:,.0f} MiB of --max-memory"
    return LimitError(sentence, where=request.asset, code="memory-limit")


def main(order: str) -> None:
    """Entry point of the rendering process; an error is a line of JSON on stderr."""
    from .. import process_memory
    from . import _leave, _start

    process_memory.owns_process = True
    request = Request(**json.loads(Path(order).read_text(encoding="utf-8")))
    _start()
    code = 0
    try:
        process_memory.hold(request.memory_bytes, False, _memory_watch)
        with watching_files():
            for place in request.places:
                note_output(place)
            _draw(request)
    except MemoryError:
        code = _report(_too_large(request))
    except PrimrayError as error:
        code = _report(error)
    except Exception as error:
        code = _report(InternalError(f"{type(error).__name__}: {error}", where=request.asset))
    _leave(code)


def _memory_watch() -> Watch:
    from ..core import compiled

    return compiled.watch_memory


def _report(error: PrimrayError) -> int:
    from .console import dumps

    told = {"code": error.code, "message": error.message, "where": error.where, "exit_code": error.exit_code}
    print(dumps(told), file=sys.stderr)
    return error.exit_code


def _draw(request: Request) -> None:
    import numpy as np

    from ..diagnostic_messages import diagnostics_lines
    from ..render.prepare import open_once
    from ..render.render import rendered_frames
    from ..settings import RenderSettings
    from ..usd import camera_paths

    largest = max(request.sizes)
    values = dict(request.settings)
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    values |= {"max_memory_bytes": request.memory_bytes, "time_limit_s": request.timeout_s * _SAMPLING_SHARE}
    opened = open_once(request.asset, RenderSettings(**values))
    # The automatic view fills a square best, whatever the asset's form; a camera's frame is its author's.
    has_camera = values.get("camera") is not None or bool(camera_paths(opened.stage))
    shapes = ((largest, 0), (0, largest)) if has_camera else ((largest, largest),)
    for image in rendered_frames(opened, [RenderSettings(**values, resolution=shape) for shape in shapes], is_quiet=True):
        if max(image.resolution) <= largest:  # not a camera's upright frame
            break
    if not (np.asarray(image.seen)[..., 3] > 0).any():
        sentence = "the picture shows nothing of it: choose a camera with --camera, a time with --frames, or --purposes"
        raise SceneError(sentence, where=request.asset, code="nothing-seen")
    shown = image.to_uint8()
    for size, file in zip(request.sizes, request.files, strict=True):
        _write_png(_reduced(shown, size), file, request.text)
    print(*diagnostics_lines(image.report["diagnostics"], verbose=True), sep="\n", file=sys.stderr)


def _reduced(shown: npt.NDArray[np.uint8], size: int) -> npt.NDArray[np.uint8]:
    """Return display values whose longer side has `size` pixels, as means that are weighted by coverage."""
    import numpy as np
    import OpenImageIO as oiio

    height, width = shown.shape[:2]
    if max(width, height) <= size:
        return shown
    scale = size / max(width, height)
    target = (max(1, round(width * scale)), max(1, round(height * scale)))
    values = shown.astype(np.float32) / 255
    values[..., :3] *= values[..., 3:]
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, 4, oiio.FLOAT))
    buffer.set_pixels(oiio.ROI(0, width, 0, height, 0, 1, 0, 4), values)
    small = oiio.ImageBufAlgo.resize(buffer, filtername="box", roi=oiio.ROI(0, target[0], 0, target[1], 0, 1, 0, 4))
    found = np.asarray(small.get_pixels(oiio.FLOAT), np.float32).reshape(target[1], target[0], 4)
    alpha = found[..., 3:]
    found[..., :3] = np.divide(found[..., :3], alpha, out=np.zeros_like(found[..., :3]), where=alpha > 0)
    made: npt.NDArray[np.uint8] = (np.clip(found, 0, 1) * 255 + 0.5).astype(np.uint8)
    return made


def _write_png(values: npt.NDArray[np.uint8], file: str, text: Mapping[str, str]) -> None:
    import OpenImageIO as oiio

    from ..images.writers import write_parts_of

    height, width, channels = values.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT8)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    for name, value in text.items():
        spec.attribute(name, value)
    write_parts_of(file, [(spec, values)])


# The cache of the Freedesktop Thumbnail Managing Standard 0.9: folders by size.
CACHED_SIZES = {128: "normal", 256: "large", 512: "x-large", 1024: "xx-large"}
# Characters that GLib leaves in a file's URI, whose MD5 is the thumbnail's name.
_PLAIN = "!$&'()*+,-./:=@_~"


def uri_of(asset: Path) -> str:
    return "file://" + quote(os.fsencode(os.path.abspath(asset)), safe=_PLAIN)


def cache_files(asset: Path, sizes: Sequence[int]) -> list[Path]:
    """Return the files of these sizes in the user's cache of thumbnails."""
    for size in sizes:
        if size not in CACHED_SIZES:
            known = ", ".join(map(str, CACHED_SIZES))
            raise SettingsError(f"the cache of thumbnails has the sizes {known}, not {size}", where="--size", code="thumbnail")
    return [_cached(asset, CACHED_SIZES[size]) for size in sizes]


def _cached(asset: Path, folder: str) -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    name = hashlib.md5(uri_of(asset).encode(), usedforsecurity=False).hexdigest() + ".png"
    return Path(home, "thumbnails", folder, name)


def cache_text(asset: Path) -> dict[str, str]:
    """Return what a cached thumbnail says about its asset, by which file browsers see whether it is out of date."""
    status = asset.stat()
    facts = {"URI": uri_of(asset), "MTime": str(int(status.st_mtime)), "Size": str(status.st_size)}
    return {f"Thumb::{name}": text for name, text in facts.items()} | {"Software": "primray"}


def failure_file(asset: Path) -> Path:
    """Return where the cache records that this version cannot make the asset's thumbnail."""
    return _cached(asset, f"fail/primray-{__version__}")


def failed_before(asset: Path) -> str | None:
    """Return the recorded error of an asset that has not changed since; None: there is none."""
    import OpenImageIO as oiio

    file = failure_file(asset)
    if not file.is_file():
        return None
    spec = oiio.ImageBuf(str(file)).spec()
    text = cache_text(asset)
    if any(spec.getattribute(name) != text[name] for name in ("Thumb::URI", "Thumb::MTime")):
        return None
    return str(spec.getattribute("ImageDescription") or "")  # as OpenImageIO calls it


def record_failure(asset: Path, error: PrimrayError, text: Mapping[str, str]) -> None:
    """Record the error in the cache, as an empty picture with the text of a thumbnail, so that nobody tries in vain again."""
    import numpy as np

    from ..images.output_path import make_folder

    file = failure_file(asset)
    make_folder(file)
    with tempfile.TemporaryDirectory(prefix="primray-thumbnail-") as folder:
        made = Path(folder, "fail.png")
        said = error.message.encode("latin-1", "replace").decode("latin-1")  # what a PNG's text can hold
        _write_png(np.zeros((1, 1, 4), np.uint8), str(made), {**text, "Description": f"{error.code}: {said}"})
        place(made, file, 0o600)


def place(made: Path, target: Path, mode: int | None = None) -> None:
    """Move a finished file to its place, atomically; its mode is `mode`, or that of new files."""
    from ..images.output_path import name_beside, through_links

    target = through_links(target)
    beside = target.with_name(f".{name_beside(target.name)}.{os.getpid()}.{os.urandom(4).hex()}")
    try:
        # Created by its mode: nobody else can read a thumbnail of the cache, not even for a moment.
        number = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666 if mode is None else mode)
        with open(number, "wb") as copy:
            copy.write(made.read_bytes())
        if mode is not None:
            os.chmod(beside, mode)
        os.replace(beside, target)
    except OSError as error:
        raise PrimrayError(f"the file cannot be written: {error.strerror}", where=str(target), code="write-failed") from None
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def author(asset: Path, name: str, picture: Path) -> None:
    """Have the asset's default prim name the picture; the asset is replaced atomically and keeps its mode."""
    from ..images.output_path import through_links
    from ..usd import write_with_preview

    file = through_links(asset)
    with tempfile.TemporaryDirectory(prefix="primray-thumbnail-") as folder:
        made = Path(folder, f"asset{asset.suffix}")
        scratch = Path(folder, "entries")
        scratch.mkdir()
        write_with_preview(str(file), name, str(picture), str(made), str(scratch))
        place(made, file, file.stat().st_mode & 0o7777)
