"""Stages from text, and what translation makes of them."""

from __future__ import annotations

from pxr import Usd

from primray.description import SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

Translated = tuple[SceneDescription, list[tuple[str, str]]]


def stage_of(text: str) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(text if text.startswith("#usda") else f'#usda 1.0\n(\n    upAxis = "Y"\n)\n{text}')
    return stage


def translate_text(text: str, settings: RenderSettings | None = None) -> Translated:
    """The description and the diagnostics as (code, prim path)."""
    description, diagnostics = translate(stage_of(text), settings or RenderSettings())
    return description, [(d.code, d.prim_path) for d in diagnostics]
