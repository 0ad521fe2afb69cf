"""Stages from text and their pictures, for the cases about where things stand and how they are scaled."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Usd

from primray import Filter, RenderSettings, render
from primray.images.image import Image

Doubles = npt.NDArray[np.float64]
TRANSLATE = """double3 xformOp:translate = (%r, %r, %r)
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
CUBE = """int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1), (1, -1, -1), (1, -1, 1), (1, 1, -1), (1, 1, 1)]"""


def stage_of(text: str) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString("#usda 1.0\n" + text)
    return stage


def shot(text: str, **settings: Any) -> Image:
    return picture_of(stage_of(text), **settings)


def codes(image: Image) -> list[str]:
    return [d["code"] for d in image.report["diagnostics"] if d["code"] != "empty-picture"]


def apart(found: Image, expected: Image, expected_again: Image) -> float:
    """Mean square difference of two pictures, in that of two pictures of the same with other random numbers."""
    noise = np.mean((expected.pixels.astype(np.float64) - expected_again.pixels) ** 2)
    assert noise > 0
    return float(np.mean((found.pixels.astype(np.float64) - expected.pixels) ** 2) / noise)


def matrix_text(m: Doubles) -> str:
    """A column-vector matrix (3, 4) or (4, 4) as USD writes it."""
    whole = np.vstack([m[:3], [0, 0, 0, 1]]).T
    return "( " + ", ".join("(" + ", ".join(f"{x!r}" for x in row) + ")" for row in whole.tolist()) + " )"


def problems(image: Image) -> list[str]:
    """Codes of the diagnostics that are more than information; whether the picture is black, tests see themselves."""
    return [d["code"] for d in image.report["diagnostics"] if d["severity"] != "info" and d["code"] != "empty-picture"]


def bound(value: float) -> str:
    """A power of ten above a figure that is small and not the same on every machine; whatever is less than 1e-6 is that."""
    return f"below 1e{max(math.floor(math.log10(max(value, 1e-30))) + 1, -6):d}"


def picture_of(stage: Usd.Stage, **settings: Any) -> Image:
    """A small picture with a box filter."""
    defaults: dict[str, Any] = {"resolution": (64, 48), "spp": 16, "max_depth": 3, "filter": Filter.BOX, "threads": 2}
    return render(stage, RenderSettings(**(defaults | settings)))
