"""Stages of one ball whose material carries another renderer's shaders alone, and what becomes of its surface."""

from __future__ import annotations

import numpy as np
from tests.unit.usd.usd_text import stage_of

from primray.description import Surface
from primray.settings import RenderSettings
from primray.usd import translate

BALL = """
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
}
"""


def stage(surface: str, nodes: str = "", context: str = "arnold:", more: str = "") -> str:
    """Return a stage whose material's output of a context leads to the shader "s"; `surface`: what that shader says."""
    return f"""
def Material "m"
{{
    token outputs:{context}surface.connect = </m/s.outputs:out>
    {more}
    def Shader "s"
    {{
        {surface}
        token outputs:out
    }}
    {nodes}
}}
{BALL}"""


def shader(identifier: str, inputs: str = "") -> str:
    return f'uniform token info:id = "{identifier}"\n{inputs}'


def node(name: str, identifier: str, inputs: str = "", outputs: str = "token outputs:out") -> str:
    return f'def Shader "{name}"\n{{\n{shader(identifier, inputs)}\n{outputs}\n}}\n'


def surface_of(text: str, settings: RenderSettings | None = None) -> tuple[Surface, dict[str, list[str]]]:
    """Return the ball's surface, and the messages by their codes."""
    description, diagnostics = translate(stage_of(text), settings or RenderSettings())
    found: dict[str, list[str]] = {}
    for d in diagnostics:
        found.setdefault(d.code, []).append(d.message)
    return description.surfaces[int(np.asarray(description.shapes[0].surface))], found
