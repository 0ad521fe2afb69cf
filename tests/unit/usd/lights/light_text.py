"""Stages of lights, translated."""

from __future__ import annotations

from primray.description import SceneDescription
from primray.diagnostics import Diagnostic
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

NO_DEFAULT = RenderSettings(default_light=False)


def translated(text: str, up: str = "Y") -> tuple[SceneDescription, list[Diagnostic]]:
    text = text.replace("{ ", "{\n").replace(" }", "\n}")  # a statement of usda ends with its line
    description, diagnostics = translate(stage_of(f'#usda 1.0\n(\n    upAxis = "{up}"\n)\n{text}'), NO_DEFAULT)
    return description, list(diagnostics)


def told(found: list[Diagnostic], path: str) -> list[tuple[str, str]]:
    return [(d.code, d.attribute) for d in found if d.prim_path == path]
