"""The pictures that one command renders: frames of the stage, of several of its products, or of an orbit around the scene.

`--turntable N` renders N pictures from an orbit, and with `--fps` a movie of them, made by ffmpeg.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from ..errors import SettingsError
from ..render.frames import FrameName, check_names, frame_name
from ..settings import RenderSettings

if TYPE_CHECKING:
    from ..images.image import Image
    from ..render import OpenedStage
    from ..render.products import Product


@dataclass(frozen=True)
class Shot:
    """One picture and the files it is written to. `report` is the JSON file beside them."""

    settings: RenderSettings
    files: list[str]
    report: str | None = None
    products: Mapping[str, Product] = field(default_factory=dict)  # the product that each file is for, if any
    with_record: bool = False  # files of products include the picture and its standard errors, ordered or not
    reports: list[dict[str, Any]] | None = None  # reports of the frame's renders so far, if its products share a report file

    def report_file_of(self, report: dict[str, Any]) -> dict[str, Any]:
        """Return the content of the report file after this render; for products, the reports of the whole frame."""
        if self.reports is None:
            return report
        self.reports.append(report)
        return {"renders": self.reports}

    def image_in(self, file: str, image: Image) -> Image:
        """Return the image with the content of the file."""
        product = self.products.get(file)
        return image if product is None else product.image_of(image, record=self.with_record)


def moments(time_codes: list[float] | None) -> list[float | None]:
    """Return the requested frames, or the stage's default time."""
    return [*time_codes] if time_codes else [None]


def require_only_products(chosen_twice: bool, are_named: bool, checkpoint: str | None) -> None:
    """Raise SettingsError for flags that exclude products: both ways to choose them, file names, checkpoints."""
    faults = {
        "--all-products and --product both choose products; give one of them": chosen_twice,
        "-o names one file, but products have their own file names; --output-dir chooses their folder": are_named,
        "products have no checkpoints; --checkpoint and --resume are for a single picture, named by -o": checkpoint is not None,
    }
    for sentence, is_so in faults.items():
        if is_so:
            raise SettingsError(sentence, code="product-output")


def product_shots(
    scene: str,
    settings: RenderSettings,
    asked: Sequence[str] | None,
    folder: str | None,
    time_codes: list[float] | None,
    with_record: bool = False,
    report: str | None = None,
) -> tuple[OpenedStage, list[Shot]]:
    """Return the opened stage, and shots of the requested products (None: all), frame by frame, under their own names.

    Relative names are below `folder`. `report` is the file for the reports of a frame's renders.
    """
    from ..render import open_once
    from ..render.products import check_files, products_of, renders_of

    opened = open_once(scene, settings)
    products = products_of(opened, settings, asked)
    names = {product.path: _name_in_frames(product, time_codes) for product in products}
    if report is not None:
        check_names([frame_name(report)], time_codes)
    shots, written = [], []
    for time_code in moments(time_codes):
        report_file = None if report is None else frame_name(report).of(time_code)
        reports: list[dict[str, Any]] | None = None if report is None else []
        for own, made in renders_of(products):
            files = [str(Path(folder or "", names[product.path].numbered(time_code))) for product in made]
            written += [(file, product.path) for file, product in zip(files, made, strict=True)]
            by_file = dict(zip(files, made, strict=True))
            shots.append(
                Shot(
                    settings=replace(own, time_code=time_code),
                    files=files,
                    report=report_file,
                    products=by_file,
                    with_record=with_record,
                    reports=reports,
                )
            )
    check_files(written)
    return opened, shots


def _name_in_frames(product: Product, time_codes: list[float] | None) -> FrameName:
    name = frame_name(product.file_name)
    if time_codes is None and name.has_holder:  # the stage's author intended frames
        raise SettingsError("the product's name has a frame placeholder; pass --frames", where=str(name), code="frames")
    # A name without a frame placeholder gets one, which has room for fractions.
    check_names([name if name.has_holder else frame_name(f"{name}.$FF")], time_codes)
    return name


PLAYABLE = (".png", ".jpg", ".jpeg")
MOST = 100_000
NO_PROGRAM = (
    "a movie needs ffmpeg, and neither it nor the package imageio-ffmpeg is installed: "
    "run `pip install imageio-ffmpeg`, or remove --fps to write only the pictures"
)
FPS_ALONE = "--fps is the frame rate of a --turntable movie; a stage has framesPerSecond in its root layer"
# H.264 that every player supports: even sides, and 4:2:0 chroma.
CODEC = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p"]


def turntable_numbers(count: int | None, fps: float | None, time_codes: Sequence[float] | None) -> list[float] | None:
    """Return the picture numbers used in file names, from 1; None if no turntable is requested."""
    if count is None:
        if fps is not None:
            raise SettingsError(FPS_ALONE, where="--fps", code="turntable")
        return None
    if not 1 <= count <= MOST:
        raise SettingsError(f"a turntable has 1 to {MOST} pictures, not {count}", where="--turntable", code="turntable")
    if fps is not None and not fps > 0:
        raise SettingsError(f"the frame rate of a movie must be above 0, not {fps}", where="--fps", code="turntable")
    if time_codes is not None and len(time_codes) > 1:
        raise SettingsError("a turntable shows one frame, but --frames has several", where="--turntable", code="turntable")
    return [float(number) for number in range(1, count + 1)]


def turntable_shots(
    settings: RenderSettings, numbers: Sequence[float], names: list[FrameName], report: FrameName | None
) -> list[Shot]:
    check_names([*names, *([report] if report else [])], numbers)
    step = 360 / len(numbers)
    return [
        Shot(
            replace(settings, orbit_deg=settings.orbit_deg + k * step),
            [name.of(number) for name in names],
            report.of(number) if report else None,
        )
        for k, number in enumerate(numbers)
    ]


@dataclass(frozen=True)
class Movie:
    """An MP4 beside the pictures that `frames` names, made by the ffmpeg at `program`."""

    frames: FrameName
    fps: float
    program: str


def movie_of(names: Sequence[FrameName], fps: float | None) -> Movie | None:
    """Return the movie that --fps requests, or None; SettingsError if it cannot be made. Called before the first picture."""
    if fps is None:
        return None
    frames = _playable(names)
    program = _program()
    if program is None:
        raise SettingsError(NO_PROGRAM, where="--fps", code="movie-program")
    return Movie(frames, fps, program)


def _playable(names: Sequence[FrameName]) -> FrameName:
    found = next((name for name in names if str(name).lower().endswith(PLAYABLE)), None)
    if found is None:
        sentence = "a movie needs PNG or JPEG pictures: name one with -o, such as -o turn.png"
        raise SettingsError(sentence, where="--fps", code="turntable")
    return found


def write_movie(movie: Movie, numbers: Sequence[float]) -> None:
    """Write the movie of the pictures that have these numbers."""
    files = [Path(movie.frames.of(number)).absolute() for number in numbers]
    path = files[0].with_name(f"{_without_number(files[0].stem)}.mp4")
    listing = "".join(f"file {_quoted(str(file))}\nduration {1 / movie.fps:.9g}\n" for file in files)
    # The listing is a file, because ffmpeg 9 resolves names in a piped listing as addresses relative to the pipe.
    with TemporaryDirectory() as folder:
        listed = Path(folder, "pictures.txt")
        listed.write_text(listing, encoding="utf-8")
        reading = ["-v", "error", "-y", "-f", "concat", "-safe", "0", "-i", str(listed)]
        command = [movie.program, *reading, *CODEC, "-r", f"{movie.fps:g}", str(path)]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, text=True, capture_output=True, check=False)
    if done.returncode != 0:
        print(f"no movie: ffmpeg failed: {done.stderr.strip()[-500:]}", file=sys.stderr)
        raise SystemExit(1)
    print(f"{path}: {len(files)} pictures at {movie.fps:g} per second")


def _without_number(stem: str) -> str:
    """Return the part of a name before the number at its end."""
    return stem.rstrip("0123456789").rstrip("._-") or stem


def _quoted(path: str) -> str:
    """Return a path quoted for ffmpeg's concat demuxer: within single quotes only these are special."""
    return "'" + path.replace("'", "'\\''") + "'"


def _program() -> str | None:
    """Return the path of ffmpeg, or None. The package imageio-ffmpeg lacks it on some platforms."""
    found = shutil.which("ffmpeg")
    if found is None and find_spec("imageio_ffmpeg") is not None:
        with suppress(RuntimeError):
            return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    return found
