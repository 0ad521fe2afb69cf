"""`--turntable N`: N pictures from an orbit around the scene, and with `--fps` a movie of them, made by ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from ..errors import SettingsError
from ..render.frames import FrameName, check_names
from ..settings import RenderSettings
from .shots import Shot

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
