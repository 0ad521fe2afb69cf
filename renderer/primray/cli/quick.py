"""Fast parser for plain `primray render` command lines, because Typer takes longer to import than NumPy.

It is not a second command line: help, errors and anything unusual are left to Typer, which then parses the whole line.
`test_quick.py` checks the table against Typer's options.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ..settings import AutoCamera, DefaultWrap, Filter, Ground, Metric, RenderContext, StopAt, StudioLight
from .option_values import ColorCorrection, Complexity, OnOff

FLAG, SWITCH = "flag", "switch"  # True; True for the first name, False for the second
LIST, PAIR, SPAN, FOUR = "list", "pair", "span", "four"  # repeatable values; two integers; two numbers; four numbers
Kind = Callable[[str], Any] | str


def _number(text: str) -> float:
    if not re.fullmatch(r"\d{1,15}(\.\d{1,15})?(e-?\d{1,2})?", text):
        raise ValueError(text)
    return float(text)


def _whole(text: str) -> int:
    if not re.fullmatch(r"\d{1,15}", text):
        raise ValueError(text)
    return int(text)


# Parameters with their kind and flags.
TABLE: dict[str, tuple[Kind, tuple[str, ...]]] = {
    "outputs": (LIST, ("--output", "-o")),
    "camera": (str, ("--camera", "-c", "-cam")),
    "auto_camera": (AutoCamera, ("--auto-camera",)),
    "render_pass": (str, ("--render-pass", "--renderPassPrimPath", "-rp")),
    "render_settings": (str, ("--render-settings", "--renderSettingsPrimPath", "-rs", "--settings", "-s")),
    "product": (LIST, ("--product", "--products")),
    "all_products": (FLAG, ("--all-products",)),
    "output_dir": (str, ("--output-dir",)),
    "record": (FLAG, ("--record",)),
    "res": (PAIR, ("--res", "-r", "--resolution")),
    "image_width": (_whole, ("--imageWidth", "-w")),
    "res_scale": (_number, ("--res-scale", "-S")),
    "frames": (str, ("--frames", "--frame", "-f")),
    "frame_count": (_whole, ("--frame-count", "-n")),
    "frame_inc": (_number, ("--frame-inc", "-i")),
    "default_time": (FLAG, ("--defaultTime", "-d")),
    "spp": (_whole, ("--spp", "--pixel-samples", "-p", "--max-samples")),
    "target_error": (_number, ("--target-error",)),
    "error_metric": (Metric, ("--error-metric", "--metric")),
    "time_limit": (_number, ("--time-limit", "--max-seconds")),
    "denoise": (SWITCH, ("--denoise", "--no-denoise")),
    "stop_at": (StopAt, ("--stop-at",)),
    "sample_range": (str, ("--sample-range",)),
    "checkpoint": (str, ("--checkpoint",)),
    "checkpoint_every": (_number, ("--checkpoint-every",)),
    "resume": (str, ("--resume",)),
    "adaptive": (SWITCH, ("--adaptive", "--no-adaptive")),
    "max_depth": (_whole, ("--max-depth",)),
    "clamp_indirect": (_number, ("--clamp-indirect",)),
    "caustics": (OnOff, ("--caustics",)),
    "pixel_filter": (Filter, ("--filter",)),
    "filter_width": (_number, ("--filter-width",)),
    "threads": (_whole, ("--threads", "-j")),
    "seed": (_whole, ("--seed", "--lock-random")),
    "rendering_color_space": (str, ("--rendering-color-space",)),
    "display": (str, ("--display",)),
    "aovs": (LIST, ("--aov", "--aovs")),
    "aov_errors": (FLAG, ("--aov-errors",)),
    "view": (str, ("--view",)),
    "look": (str, ("--look",)),
    "color_correction": (ColorCorrection, ("--colorCorrectionMode", "-color")),
    "make_output_path": (FLAG, ("--make-output-path",)),
    "snapshot": (_number, ("--snapshot",)),
    "ray": (str, ("--ray",)),
    "list_cameras": (FLAG, ("--list-cameras",)),
    "exposure": (str, ("--exposure",)),
    "strict": (FLAG, ("--strict",)),
    "fail_on": (LIST, ("--fail-on",)),
    "allow": (LIST, ("--allow",)),
    "max_memory": (str, ("--max-memory",)),
    "dicing_rate": (_number, ("--dicing-rate",)),
    "no_motion_blur": (FLAG, ("--no-motion-blur", "--disable-motionblur")),
    "shutter": (SPAN, ("--shutter",)),
    "region": (FOUR, ("--region",)),
    "motion_error": (_number, ("--motion-error",)),
    "bit_depth": (_whole, ("--bit-depth",)),
    "half": (LIST, ("--half",)),
    "compression": (str, ("--compression",)),
    "metadata": (LIST, ("--metadata",)),
    "stereo": (FLAG, ("--stereo",)),
    "diffusion": (_number, ("--diffusion",)),
    "diffusion_glare": (_number, ("--diffusion-glare",)),
    "diffusion_bloom_width": (_number, ("--diffusion-bloom-width",)),
    "diffusion_starburst": (_number, ("--diffusion-starburst",)),
    "diffusion_starburst_width": (_number, ("--diffusion-starburst-width",)),
    "lens": (LIST, ("--lens",)),
    "complexity": (Complexity, ("--complexity",)),
    "report": (str, ("--report",)),
    "json": (FLAG, ("--json",)),
    "no_default_light": (FLAG, ("--no-default-light", "--disableCameraLight")),
    "studio_light": (StudioLight, ("--studio-light",)),
    "dome": (str, ("--dome",)),
    "dome_rotation": (_number, ("--dome-rotation",)),
    "dome_visible": (OnOff, ("--dome-visible",)),
    "ground": (Ground, ("--ground",)),
    "background": (str, ("--background",)),
    "turntable": (_whole, ("--turntable",)),
    "fps": (_number, ("--fps",)),
    "preview": (FLAG, ("--preview",)),
    "default_wrap": (DefaultWrap, ("--default-wrap",)),
    "render_context": (RenderContext, ("--render-context",)),
    "no_translated_shaders": (FLAG, ("--no-translated-shaders",)),
    "purposes": (str, ("--purposes", "--purpose")),
    "variants": (LIST, ("--variant", "--variants")),
    "no_payloads": (FLAG, ("--no-payloads",)),
    "load": (LIST, ("--load",)),
    "mask": (LIST, ("--mask",)),
    "session_layer": (str, ("--session-layer", "--sessionLayer")),
    "verbose": (FLAG, ("--verbose", "-V")),
}
_BY_FLAG = {flag: (name, kind) for name, (kind, flags) in TABLE.items() for flag in flags}


def render_arguments(line: Sequence[str]) -> dict[str, Any] | None:
    """Return the arguments of `render`, or None if the line is for another command or not plain."""
    if not line or line[0] != "render":
        return None
    try:
        return _read(iter(line[1:]))
    except (ValueError, StopIteration):
        return None


def _read(words: Iterator[str]) -> dict[str, Any]:
    places: list[str] = []
    given: dict[str, Any] = {}
    for word in words:
        if not word.startswith("-"):
            places.append(word)
            continue
        flag, joined, text = word.partition("=") if word.startswith("--") else (word, "", "")
        name, kind = _BY_FLAG.get(flag, ("", FLAG))
        if not name or (joined and kind in (FLAG, SWITCH, PAIR, SPAN, FOUR)):
            raise ValueError(word)
        values = iter([text]) if joined else words
        if kind == FLAG:
            given[name] = True
        elif kind == SWITCH:
            given[name] = flag == TABLE[name][1][0]
        elif kind == LIST:
            given.setdefault(name, []).append(_value(values))
        elif kind == PAIR:
            given[name] = (_whole(next(values)), _whole(next(values)))
        elif kind == SPAN:
            given[name] = (_number(next(values)), _number(next(values)))
        elif kind == FOUR:
            given[name] = tuple([_number(next(values)) for _ in range(4)])
        elif callable(kind):
            given[name] = kind(_value(values))
    if not 1 <= len(places) <= 2 or not all(places):
        raise ValueError("the scene, and perhaps the output")
    return given | dict(zip(("scene", "output"), places, strict=False))


def _value(values: Iterator[str]) -> str:
    text = next(values)
    if text.startswith("-") or not text:
        raise ValueError(text)
    return text
