"""Surface nodes that are known by name, what becomes of them, and what is told of them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from primray.description import OpenPbr, Surface
from primray.settings import RenderSettings
from primray.usd import translate

from .material_text import material
from .usd_text import stage_of

CODES = ("material-input", "mdl-material")


def described(text: str, settings: RenderSettings | None = None) -> tuple[Surface, list[str]]:
    """The ball's surface, and the messages that are about inputs."""
    description, diagnostics = translate(stage_of(text), settings or RenderSettings())
    shape = description.shapes[0]
    return description.surfaces[int(np.asarray(shape.surface))], [d.message for d in diagnostics if d.code in CODES]


def known(shader: str, inputs: str = "", nodes: str = "") -> tuple[Surface, list[str]]:
    return described(material(inputs, nodes, shader=shader))


def lobes(surface: Surface) -> dict[str, Any]:
    """Of its OpenPBR inputs, those that are not at their defaults."""
    assert surface.open_pbr is not None
    found = {f.name: getattr(surface.open_pbr, f.name) for f in fields(OpenPbr)}
    return {name: value for name, value in found.items() if value != getattr(OpenPbr(), name)}


def close(values: dict[str, Any]) -> dict[str, Any]:
    return {name: pytest.approx(value, rel=1e-6, abs=1e-9) for name, value in values.items()}


def near(*names: str) -> list[str]:
    return [f"Approximated: {', '.join(names)}."]


def unused(*names: str) -> list[str]:
    return [f"Not supported, or only in part: {', '.join(names)}."]


IMAGE = """
    def Shader "image"
    {{
        uniform token info:id = "ND_image_{kind}"
        asset inputs:file = @{file}@
        {kind}{suffix} outputs:out
    }}"""


def image_node(file: str, kind: str = "float") -> str:
    text = IMAGE.format(kind=kind, file=file, suffix="")
    return text.replace("color3 outputs", "color3f outputs").replace("vector3 outputs", "float3 outputs")
