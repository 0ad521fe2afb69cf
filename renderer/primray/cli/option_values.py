"""Conversion of option values from text to settings. This module does not import Typer (see quick.py)."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, Literal

from ..aovs import AOVS
from ..errors import SettingsError
from ..images.encoding import BIT_DEPTHS, Encoding, compression_of
from ..process_memory import available_bytes
from ..render.frames import frame_list, names_ends, parse_frames, with_ends
from ..settings import DEFAULT_DICING_RATE, SAMPLE_BLOCK, check_stops
from ..settings.light_mixes import checked_weight, text_of_weights
from .output_targets import suffix_of

_LEAST_MEMORY = 2**20  # a smaller number most likely lacks its unit
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


class Complexity(Enum):
    """Complexity of usdrecord and husk. Each level halves the edges of the previous one, like a refinement level there."""

    LOW = "low"
    MEDIUM = "medium"
    HIGH = "high"
    VERYHIGH = "veryhigh"


# Longest edge in pixels.
DICING_RATES = {Complexity.LOW: 16.0, Complexity.MEDIUM: 8.0, Complexity.HIGH: 4.0, Complexity.VERYHIGH: 2.0}


class ColorCorrection(Enum):
    """Colour correction mode of usdrecord."""

    DISABLED = "disabled"
    SRGB = "sRGB"
    OPENCOLORIO = "openColorIO"


# View names of OpenColorIO's built-in configurations; None: the display's default.
VIEWS = {ColorCorrection.DISABLED: "Raw", ColorCorrection.SRGB: "Un-tone-mapped", ColorCorrection.OPENCOLORIO: None}


def camera_of(camera: str | None) -> str | None:
    """Return the camera. SettingsError, with advice, if usdrecord's complexity was given as `-c`."""
    if camera in [complexity.value for complexity in Complexity]:
        sentence = f"-c chooses a camera; for usdrecord's complexity use --complexity {camera}"
        raise SettingsError(sentence, code="camera")
    return camera


def render_settings_of(prim: str | None) -> str | None:
    """Return the prim path; a name alone is a prim in /Render, as in husk."""
    return f"/Render/{prim}" if prim and not prim.startswith("/") else prim


def dicing_rate_of(dicing_rate: float, complexity: Complexity | None) -> float:
    if complexity is None:
        return dicing_rate
    if dicing_rate != DEFAULT_DICING_RATE:
        raise SettingsError("--dicing-rate and --complexity both set the dicing rate; give one of them", code="dicing")
    return DICING_RATES[complexity]


def scale_of(percent: float) -> float:
    return percent / 100


def view_of(view: str | None, correction: ColorCorrection | None) -> str | None:
    if correction is None:
        return view
    if view is not None:
        raise SettingsError("--view and --colorCorrectionMode both choose a view; give one of them", code="view")
    return VIEWS[correction]


def exposure_of(stops: str | None) -> float | Literal["auto"] | None:
    """Return the exposure of views; None leaves it to the stage."""
    if stops is None or stops == "auto":
        return None if stops is None else "auto"
    return check_stops(stops, "--exposure")


def threads_of(threads: int | None) -> int | None:
    """Return the number of threads, or None for all. Negative numbers leave that many cores free, as in husk."""
    if threads is None or threads > 0:
        return threads
    if threads == 0:
        return None
    from ..report.report import usable_threads

    return max(1, usable_threads() + threads)


def resolution_of(res: tuple[int, int] | None, image_width: int | None) -> tuple[int, int] | None:
    if res is not None and image_width is not None:
        raise SettingsError("--res and --imageWidth both set the picture's width; give one of them", code="resolution")
    return res if image_width is None else (image_width, 0)


def frames_of(
    frames: str | None,
    count: int | None,
    increment: float | None,
    default_time: bool,
    scene: str | None,
    session_layer: str | None,
) -> str | None:
    """Return the frame list, with the stage's `start` and `end` as numbers; None: the stage's default time."""
    if default_time and (frames, count, increment) != (None, None, None):
        raise SettingsError("--defaultTime cannot be combined with frames; give one of them", code="frames")
    if frames is not None and scene is not None and names_ends(frames):
        from ..usd.stage.open import time_range

        frames = with_ends(frames, *time_range(scene, session_layer))
    if count is not None or increment is not None:
        frames = frame_list("1" if frames is None else frames, 1 if count is None else count, increment)
    return frames


def time_codes_of(frames: str | None) -> list[float] | None:
    """Return the frames of a list, without duplicates: lists such as 1-3,2 overlap."""
    return None if frames is None else list(dict.fromkeys(parse_frames(frames)))


def one_frame_of(frames: str | None, command: str) -> float | None:
    if frames is None:
        return None
    time_codes = parse_frames(frames)
    if len(time_codes) > 1:
        raise SettingsError(f"{command} accepts only one frame", code="frames")
    return time_codes[0]


def load_of(no_payloads: bool, load: list[str] | None) -> tuple[str, ...] | None:
    if no_payloads and load:
        raise SettingsError("--no-payloads cannot be combined with --load, which already loads nothing else", code="load")
    return () if no_payloads else _paths(load)


def mask_of(mask: list[str] | None) -> tuple[str, ...] | None:
    return _paths(mask)


def _paths(texts: list[str] | None) -> tuple[str, ...] | None:
    """Return the paths, separated by commas or spaces as in usdrecord's --mask; None if there are none."""
    paths = tuple(path for text in texts or () for path in text.replace(",", " ").split())
    return paths or None


def codes_of(texts: list[str] | None) -> tuple[str, ...]:
    """Return diagnostic codes, separated by commas or spaces."""
    return _paths(texts) or ()


def purposes_of(text: str | None) -> tuple[str, ...] | None:
    """Return purposes, separated by commas or spaces. `default` is always included, as in usdrecord; husk calls it geometry."""
    if text is None:
        return None
    names = ["default" if name == "geometry" else name for name in text.replace(",", " ").split()]
    return tuple(dict.fromkeys(names if "default" in names else ["default", *names]))


# Commas, except within the braces and quotes of light path expressions.
_AT_COMMAS = re.compile(r",(?![^{}]*\})(?=(?:[^']*'[^']*')*[^']*$)")


def aovs_for(texts: list[str] | None, outputs: Sequence[str]) -> tuple[str, ...] | None:
    """Return the chosen AOVs; None: those of the stage's product, or none if no output can hold them."""
    chosen = aovs_of(texts)
    if any(suffix_of(name).lower() == ".exr" for name in outputs):
        return chosen
    if chosen:
        raise SettingsError("--aov writes parts of an EXR, but no output is an EXR: add one with -o", code="aov-output")
    return ()


def aovs_of(texts: list[str] | None) -> tuple[str, ...] | None:
    """Return the chosen AOVs; None: those of the stage's product."""
    if texts is None:
        return None
    names = tuple(name.strip() for text in texts for name in _AT_COMMAS.split(text) if name.strip())
    chosen = tuple(AOVS) if "all" in names else ()
    return chosen + tuple(name for name in names if name not in ("all", "none", *chosen))


def encoding_of(
    bit_depth: int | None, half: list[str] | None, compression: str | None = None, metadata: list[str] | None = None
) -> Encoding:
    """Return the encoding of output files.

    SettingsError for a bit depth that no format has, and for a compression or metadata that no EXR has.
    """
    known = sorted({bits for depths in BIT_DEPTHS.values() for bits in depths})
    if bit_depth is not None and bit_depth not in known:
        listed = ", ".join(map(str, known))
        raise SettingsError(f"bit depths are {listed}, not {bit_depth}", where="--bit-depth", code="bit-depth")
    names = [name.strip() for text in half or () for name in text.split(",")]
    kind, level = compression_of(compression)
    header = tuple(_attribute_of(text) for text in metadata or ())
    return Encoding(bit_depth, tuple(name for name in names if name), kind, level, header)


def _attribute_of(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        sentence = f"metadata must have the form NAME=VALUE, not {text!r}"
        raise SettingsError(sentence, where="metadata", code="exr-setting")
    return name.strip(), value


def sample_range_of(text: str | None) -> tuple[int, int] | None:
    """Return the sample range written A:B, whole numbers; RenderSettings checks them."""
    if text is None:
        return None
    match = re.fullmatch(r"\s*(\d{1,12}):(\d{1,12})\s*", text)
    if match is None:
        raise SettingsError(
            f"{text!r} is not a range of samples; expected a range such as 0:64, in multiples of {SAMPLE_BLOCK}",
            code="sample-range",
        )
    return int(match[1]), int(match[2])


def mixes_of(texts: Sequence[str]) -> list[str]:
    """Return mixes of lights as text; files (NAME.json) are reports of `primray relight`, or weights by name."""
    return [_mix_of_file(text) if text.endswith(".json") else text for text in texts]


def _mix_of_file(file: str) -> str:
    try:
        says = json.loads(Path(file).read_text(encoding="utf-8"))
        rows = says["lights"] if isinstance(says.get("lights"), list) else None
        given = says if rows is None else {row["name"]: row["weight"] for row in rows}
        return text_of_weights({str(name): checked_weight(str(name), weight) for name, weight in given.items()})
    except OSError as error:
        raise SettingsError(f"the mix cannot be read: {error.strerror}", where=file, code="lights-weight") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        sentence = 'a file of a mix is what `primray relight --report` writes, or JSON like {"key": 0.5, "fill": [1, 0.8, 0.6]}'
        raise SettingsError(sentence, where=file, code="lights-weight") from error


def bytes_of(text: str | None) -> int | None:
    """Return an amount of memory in bytes.

    "4G", "500M" and "1.5GiB" use powers of 1024; "auto" is the most this process may use.
    """
    if text is None:
        return None
    if text.strip() == "auto":
        return available_bytes()
    size = _amount_of(text, "max-memory")
    if size < _LEAST_MEMORY:
        raise SettingsError(f"{text!r} is {size:,} bytes, too few for any render; write 4G for 4 GiB", code="max-memory")
    return size


def texture_bytes_of(text: str | None) -> int | None:
    """Return an amount of memory or of disk for textures in bytes, as "400M" and "8G" say it."""
    return None if text is None else _amount_of(text, "texture-memory")


def _amount_of(text: str, code: str) -> int:
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?\s*", text, re.IGNORECASE)
    if match is None:
        raise SettingsError(f"{text!r} is not an amount of memory; expected one such as 4G or 500M", code=code)
    return int(float(match[1]) * _UNITS[match[2].upper()])


PREVIEW_SPP = 16  # denoising with fewer samples loses detail


def previewed(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the samples per pixel and the denoising of a preview, unless flags say otherwise."""
    asked = any(name in values for name in ("spp", "target_error", "time_limit_s"))
    return ({} if asked else {"spp": PREVIEW_SPP}) | {"denoise": values.get("denoise") is not False}


def check_layer_name(layer: str | None) -> None:
    """Raise SettingsError unless USD reads text from a file of this name, as it does not from .usdc."""
    if layer is not None and Path(layer).suffix.lower() not in (".usda", ".usd"):
        raise SettingsError("the layer is text: its name must end in .usda or .usd", where=layer, code="output-format")
