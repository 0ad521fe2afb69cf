"""Lights with attributes of the physical-lighting proposal, as translation has them."""

from __future__ import annotations

from primray.description import Light
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

Noted = set[tuple[str, str]]


def physical(body: str, kind: str = "SphereLight", apis: str = "", meters: float = 1.0, space: str = "") -> tuple[Light, Noted]:
    """The light, and the codes and attributes of what is told of it; `apis` with blanks between."""
    applied = ", ".join(f'"{api}"' for api in apis.split())
    head = f"(prepend apiSchemas = [{applied}])" if apis else ""
    text = f'#usda 1.0\n(\n    metersPerUnit = {meters}\n    upAxis = "Y"\n)\ndef {kind} "light" {head}\n{{\n{body}\n}}\n'
    settings = RenderSettings(rendering_color_space=space or None)
    description, diagnostics = translate(stage_of(text), settings)
    (only,) = description.lights
    return only, {(d.code, d.attribute) for d in diagnostics if d.prim_path == "/light"}
