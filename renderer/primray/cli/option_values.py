"""The plain-text values that options take, as settings; this module imports nothing of Typer (see quick.py)."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..aov_names import AOVS
from ..errors import SettingsError
from ..render.frame_numbers import parse_frames
from ..settings import SAMPLE_BLOCK

_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


def camera_of(camera: str | None) -> str | None:
    """`-c` is a complexity in usdrecord; say so instead of looking for a camera of that name."""
    if camera in ("low", "medium", "high", "veryhigh"):
        raise SettingsError(f"-c names a camera here; usdrecord's complexity {camera!r} has no counterpart", code="camera")
    return camera


def resolution_of(res: tuple[int, int] | None, image_width: int | None) -> tuple[int, int] | None:
    if res is not None and image_width is not None:
        raise SettingsError("--res and --imageWidth both say how wide the picture is; give one", code="resolution")
    return res if image_width is None else (image_width, 0)


def one_frame_of(frames: str | None, command: str) -> float | None:
    if frames is None:
        return None
    time_codes = parse_frames(frames)
    if len(time_codes) > 1:
        raise SettingsError(f"{command} looks at one frame", code="frames")
    return time_codes[0]


def load_of(no_payloads: bool, load: list[str] | None) -> tuple[str, ...] | None:
    if no_payloads and load:
        raise SettingsError("--no-payloads and --load contradict each other; --load alone loads nothing else", code="load")
    return () if no_payloads else _paths(load)


def mask_of(mask: list[str] | None) -> tuple[str, ...] | None:
    return _paths(mask)


def _paths(texts: list[str] | None) -> tuple[str, ...] | None:
    """Also several in one, by commas, as usdrecord's --mask takes them; None for no texts at all."""
    paths = tuple(path.strip() for text in texts or () for path in text.split(",") if path.strip())
    return paths or None


def purposes_of(text: str | None) -> tuple[str, ...] | None:
    return None if text is None else tuple(name.strip() for name in text.split(",") if name.strip())


def aovs_for(texts: list[str] | None, outputs: Sequence[str]) -> tuple[str, ...] | None:
    """None: as the stage's product says, unless no output could hold them."""
    chosen = aovs_of(texts)
    if any(name.lower().endswith(".exr") for name in outputs):
        return chosen
    if chosen:
        raise SettingsError("--aov writes parts of an EXR, and no output is one: name one with -o", code="aov-output")
    return ()


def aovs_of(texts: list[str] | None) -> tuple[str, ...] | None:
    """None: as the stage's product says."""
    if texts is None:
        return None
    names = tuple(name.strip() for text in texts for name in text.split(",") if name.strip())
    chosen = tuple(AOVS) if "all" in names else ()
    return chosen + tuple(name for name in names if name not in ("all", "none", *chosen))


def sample_range_of(text: str | None) -> tuple[int, int] | None:
    """ "A:B", whole numbers; RenderSettings checks them."""
    if text is None:
        return None
    match = re.fullmatch(r"\s*(\d{1,12}):(\d{1,12})\s*", text)
    if match is None:
        raise SettingsError(
            f"{text!r} is no range of samples; write one like 0:64, in multiples of the sample block, which is {SAMPLE_BLOCK}",
            code="sample-range",
        )
    return int(match[1]), int(match[2])


def bytes_of(text: str | None) -> int | None:
    """ "4G", "500M", "1.5GiB" or plain bytes; units are powers of 1024."""
    if text is None:
        return None
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?\s*", text, re.IGNORECASE)
    if match is None:
        raise SettingsError(f"{text!r} is no amount of memory; write one like 4G or 500M", code="max-memory")
    return int(float(match[1]) * _UNITS[match[2].upper()])
