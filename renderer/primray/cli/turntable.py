"""`--turntable N`: N pictures from once around what is drawn, and a movie of them where ffmpeg is installed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from ..errors import SettingsError
from ..render.frame_names import FrameName, check_names
from ..settings import RenderSettings
from .shots import Shot

PLAYABLE = (".png", ".jpg", ".jpeg")
MOST = 100_000
FPS_ALONE = "--fps is the rate of a --turntable's movie; a stage's own is framesPerSecond of its root layer"
# H.264 for every player: even sides, and chroma of half the resolution.
CODEC = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p"]


def turntable_numbers(count: int | None, fps: float | None, time_codes: Sequence[float] | None) -> list[float] | None:
    """Return the numbers of the pictures in their names, from 1; None where no turntable is asked for."""
    if count is None:
        if fps is not None:
            raise SettingsError(FPS_ALONE, where="--fps", code="turntable")
        return None
    if not 1 <= count <= MOST:
        raise SettingsError(f"a turntable has from 1 to {MOST} pictures, not {count}", where="--turntable", code="turntable")
    if fps is not None and not fps > 0:
        raise SettingsError(f"a movie has a rate above 0, not {fps}", where="--fps", code="turntable")
    if time_codes is not None and len(time_codes) > 1:
        raise SettingsError("a turntable is of one frame; --frames names several", where="--turntable", code="turntable")
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


def playable(names: Sequence[FrameName]) -> FrameName:
    """Return the output that a movie is made of; SettingsError where there is none."""
    found = next((name for name in names if str(name).lower().endswith(PLAYABLE)), None)
    if found is None:
        sentence = "a movie is made of PNG or JPEG pictures: name one with -o, such as -o turn.png"
        raise SettingsError(sentence, where="--fps", code="turntable")
    return found


def write_movie(name: FrameName, numbers: Sequence[float], fps: float) -> None:
    """Write an MP4 beside the pictures, or say that nothing here can."""
    files = [Path(name.of(number)).absolute() for number in numbers]
    program = _program()
    if program is None:
        print(f"no movie: neither ffmpeg nor the package imageio-ffmpeg is installed; the pictures are {name}", file=sys.stderr)
        return
    movie = files[0].with_name(f"{_without_number(files[0].stem)}.mp4")
    listing = "".join(f"file {_quoted(str(file))}\nduration {1 / fps:.9g}\n" for file in files)
    reading = ["-v", "error", "-y", "-protocol_whitelist", "file,pipe", "-f", "concat", "-safe", "0", "-i", "-"]
    command = [program, *reading, *CODEC, "-r", f"{fps:g}", str(movie)]
    done = subprocess.run(command, input=listing, text=True, capture_output=True, check=False)
    if done.returncode != 0:
        print(f"no movie: ffmpeg failed: {done.stderr.strip()[-500:]}", file=sys.stderr)
        raise SystemExit(1)
    print(f"{movie}: {len(files)} pictures at {fps:g} a second")


def _without_number(stem: str) -> str:
    """The part of a name before the number at its end."""
    return stem.rstrip("0123456789").rstrip("._-") or stem


def _quoted(path: str) -> str:
    """As ffmpeg's concat demuxer reads names: between single quotes nothing is special but they."""
    return "'" + path.replace("'", "'\\''") + "'"


def _program() -> str | None:
    found = shutil.which("ffmpeg")
    if found is None and find_spec("imageio_ffmpeg") is not None:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    return found
