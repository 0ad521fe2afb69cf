"""`primray thumbnail`: a small picture of an asset for file browsers and asset libraries.

It is written beside the asset, named by the asset itself (UsdMedia's AssetPreviewsAPI), or put into the cache of file browsers.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import PrimrayError, SceneError, SettingsError, StageOpenError
from ...file_formats import why_locked
from .. import option_values
from ..flags import in_order

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..thumbnail_renders import Request

DEFAULT_SIZE = 256
# Endings of an OUTPUT that is taken for a mistake; browsers ask for names without any, or with a number's.
OTHER_PICTURES = frozenset([".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".webp", ".avif", ".gif", ".bmp"])


@in_order()
def thumbnail(
    asset: Annotated[str, typer.Argument(metavar="ASSET", help="The asset: usda, usdc, usd or usdz.", show_default=False)],
    output: Annotated[
        str | None,
        typer.Argument(
            metavar="[OUTPUT]", help="The PNG to write, whatever its name.", show_default="thumbs/ASSET.SIZE.png beside it"
        ),
    ] = None,
    sizes: Annotated[
        list[int] | None,
        typer.Option("--size", "-s", metavar="PIXELS", help="Pixels of the longer side; may be repeated.", show_default="256"),
    ] = None,
    author: Annotated[
        bool,
        typer.Option("--author", help="Have the asset's default prim name the picture of the first size (AssetPreviewsAPI)."),
    ] = False,
    cache: Annotated[
        bool, typer.Option("--cache", help="Write to the cache of file browsers: 128, 256, 512 or 1024 pixels.")
    ] = False,
    camera: str | None = None,
    frames: str | None = None,
    variants: list[str] | None = None,
    purposes: str | None = None,
    background: str | None = None,
    spp: int = 16,
    threads: int | None = None,
    timeout: float = 60.0,
    max_memory_bytes: str = "4G",
    verbose: bool = False,
) -> None:
    """Render a thumbnail of an asset: beside it, named by it (--author), or in the cache of file browsers (--cache).

    Without a camera, a square frame holds all of the asset. `--background neutral` is a light grey.
    """
    from ..thumbnail_renders import MOST_PIXELS

    asked = tuple(dict.fromkeys(sizes or [DEFAULT_SIZE]))
    if not all(1 <= size <= MOST_PIXELS for size in asked) or spp < 1 or timeout <= 0:
        sentence = f"sizes are 1 to {MOST_PIXELS} pixels; samples and the time limit must be above 0"
        raise SettingsError(sentence, code="thumbnail")
    settings = _settings(camera, frames, variants, purposes, background, spp, threads)
    memory = option_values.bytes_of(max_memory_bytes) or 0
    made = _made(Path(asset), output, asked, author, cache, settings, timeout, memory, verbose)
    print(*made, sep="\n")


def _settings(
    camera: str | None,
    frames: str | None,
    variants: list[str] | None,
    purposes: str | None,
    background: str | None,
    spp: int,
    threads: int | None,
) -> dict[str, Any]:
    from ...settings import RenderSettings
    from ..thumbnail_renders import NEUTRAL

    values = {
        "camera": option_values.camera_of(camera),
        "time_code": option_values.one_frame_of(frames, "thumbnail"),
        "variants": tuple(variants) if variants else None,
        "purposes": None if purposes is None else option_values.purposes_of(purposes),
        "background": NEUTRAL if background == "neutral" else background,
        "threads": None if threads is None else option_values.threads_of(threads),
        "spp": spp,
    }
    given: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    RenderSettings(**given)  # checked before a process is started
    return given


def _made(
    asset: Path,
    output: str | None,
    sizes: tuple[int, ...],
    is_authored: bool,
    is_cached: bool,
    settings: Mapping[str, object],
    timeout_s: float,
    memory_bytes: int,
    verbose: bool,
) -> list[Path]:
    """Render the thumbnails and put them into their places; return what was written."""
    from ...images.output_path import check_folder, make_folder
    from ..thumbnail_renders import FOLDER, Request, author, cache_text, place, render_thumbnails

    if not os.path.isfile(asset):
        is_folder = os.path.isdir(asset)
        problem = "it is a folder: `primray sheet FOLDER` shows all of a folder" if is_folder else "there is no such file"
        raise StageOpenError(why_locked(str(asset)) or problem, where=str(asset))
    is_packed = is_authored and asset.suffix.lower() == ".usdz"
    targets = _targets(asset, output, sizes, is_authored, is_cached)
    if is_authored:
        from ...usd import check_preview

        check_preview(str(asset))
        check_folder(asset)
    for target in targets:
        if output is None and not is_packed:
            make_folder(target)
        if not is_packed:
            check_folder(target)
    with tempfile.TemporaryDirectory(prefix="primray-thumbnail-") as folder:
        files = [Path(folder, f"{size}.png") for size in sizes]
        text = cache_text(asset) if is_cached else {}
        places = () if is_packed else tuple(str(target.absolute()) for target in targets)
        request = Request(str(asset.absolute()), sizes, tuple(map(str, files)), places, settings, text, timeout_s, memory_bytes)
        said = _rendered_for_cache(asset, request, Path(folder)) if is_cached else render_thumbnails(request, Path(folder))
        if verbose and said:
            print(said, file=sys.stderr)
        if not is_packed:
            for file, target in zip(files, targets, strict=True):
                place(file, target, 0o600 if is_cached else None)
        if is_authored:
            author(asset, f"./{FOLDER}/{targets[0].name}", files[0])
    return [asset] if is_packed else [*targets, *([asset] if is_authored else [])]


CHOICES = ("camera", "time_code", "variants", "purposes")  # of what a picture shows: another may be possible


def _rendered_for_cache(asset: Path, request: Request, scratch: Path) -> str:
    """Render, unless that has failed and the asset is the same; record a failure that is the asset's, not the request's."""
    from ..thumbnail_renders import failed_before, failure_file, record_failure, render_thumbnails

    is_plain = not request.settings.keys() & set(CHOICES)
    before = failed_before(asset) if is_plain else None
    if before is not None:
        sentence = (
            f"it could not be made before ({before}), and the asset has not changed; to try again, remove {failure_file(asset)}"
        )
        raise SceneError(sentence, where=str(asset), code="failed-before")
    try:
        said = render_thumbnails(request, scratch)
    except PrimrayError as error:
        if is_plain and error.exit_code != SettingsError.exit_code:
            record_failure(asset, error, request.text)
        raise
    failure_file(asset).unlink(missing_ok=True)
    return said


def _targets(asset: Path, output: str | None, sizes: tuple[int, ...], is_authored: bool, is_cached: bool) -> list[Path]:
    """Return the PNGs' places, one for each size."""
    from ..thumbnail_renders import FOLDER, cache_files

    if sum((output is not None, is_authored, is_cached)) > 1:
        raise SettingsError("OUTPUT, --author and --cache name different places; give one of them", code="thumbnail")
    if is_cached:
        return cache_files(asset, sizes)
    if output is not None:
        if len(sizes) > 1:
            raise SettingsError("an OUTPUT is one picture, but several sizes are asked for", where=output, code="thumbnail")
        if Path(output).suffix.lower() in OTHER_PICTURES:
            raise SettingsError("thumbnails are PNG files: let its name end in .png", where=output, code="thumbnail")
        return [Path(output)]
    if is_authored and asset.suffix.lower() == ".usdz" and len(sizes) > 1:
        sentence = "a usdz gets one picture, but several sizes are asked for"
        raise SettingsError(sentence, where=str(asset), code="thumbnail")
    return [asset.parent / FOLDER / f"{asset.name}.{size}.png" for size in sizes]
