"""Reasons why a picture is dark or bright: no lights, lights without emission, an exposure that does not suit the view."""

from __future__ import annotations

from collections.abc import Iterator

from ..description import Surface
from ..diagnostic_codes import CODES
from ..images.exposure import View, view_fault
from ..images.image import MISSING_TEXTURES
from .examined import Examined
from .finding import Finding, Question

LIGHTLESS = ("light-dark", "unsupported-light", "link-empty", "instanced-lights", "old-attribute")


def findings(seen: Examined) -> Iterator[Finding]:
    told = list(seen.diagnostics)
    pixels = seen.image.pixels
    glows = any(_glows(surface) for surface in seen.description.surfaces)
    if any(diagnostic.code == "default-light" for diagnostic in told):
        said = next(diagnostic.message for diagnostic in told if diagnostic.code == "default-light")
        yield Finding(Question.DARK, "default-light", said, CODES["default-light"].advice)
    elif not seen.prepared.lights and not glows:
        advice = "Add a light (a DomeLight is the simplest), or omit --studio-light off."
        yield Finding(Question.DARK, "no-light", "There is no light, and nothing is emissive.", advice)
    elif seen.hit_share > 0 and not pixels[..., :3].any():
        said = "What the camera sees is black, though there are lights: none reaches it, or its materials reflect nothing."
        yield Finding(
            Question.DARK,
            "unlit",
            said,
            "Check where lights are and face, their links and intensities; `--studio-light on` adds a light.",
        )
    for code in LIGHTLESS:
        prims = tuple(dict.fromkeys(d.prim_path for d in told if d.code == code))
        if prims:
            yield Finding(Question.DARK, code, CODES[code].meaning, CODES[code].advice, prims)
    missing = any(diagnostic.code in MISSING_TEXTURES for diagnostic in told)
    fault = view_fault(pixels, View(space=seen.image.color_space), lacks_textures=missing)
    if fault is not None:
        yield Finding(Question.DARK, fault.code, fault.message, CODES[fault.code].advice)


def _glows(surface: Surface) -> bool:
    return any(value > 0 for value in surface.emissive_color) or "emissive_color" in surface.varying
