"""Stages of one ball with one material, and what its surface becomes."""

from __future__ import annotations

import numpy as np

from primray.description import Input, Surface, TextureInput

from .usd_text import translate_text

Codes = list[tuple[str, str]]

READER = """
    def Shader "reader"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "uv"
        float2 outputs:result
    }"""
IMAGE = """
    def Shader "image"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @%s@
        float2 inputs:st.connect = </m/reader.outputs:result>
        float3 outputs:rgb
        float outputs:a
    }"""


def material(inputs: str, nodes: str = "", interface: str = "", shader: str = "UsdPreviewSurface") -> str:
    return f"""
def Material "m"
{{
    {interface}
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "{shader}"
        {inputs}
        token outputs:surface
    }}
    {nodes}
}}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </m>
}}
"""


def surface_of(text: str) -> tuple[Surface, Codes]:
    """The ball's surface, and the diagnostics that are not about cameras and lights."""
    description, found = translate_text(text)
    shape = description.shapes[0]
    ignored = {"camera-automatic", "default-light", "primvar-missing"}
    return description.surfaces[int(np.asarray(shape.surface))], [d for d in found if d[0] not in ignored]


def input_of(surface: Surface, name: str = "diffuse_color") -> Input:
    return dict(surface.inputs)[name]


def node(name: str, identifier: str, inputs: str, output: str = "float2 outputs:result") -> str:
    return f"""
    def Shader "{name}"
    {{
        uniform token info:id = "{identifier}"
        {inputs}
        {output}
    }}"""


def texture(surface: Surface, name: str = "diffuse_color") -> TextureInput:
    made = input_of(surface, name)
    assert isinstance(made, TextureInput)
    return made
