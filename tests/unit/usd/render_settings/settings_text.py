"""Render settings as text, and what is read of them."""

from __future__ import annotations

from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import ProductSettings, products

from ..usd_text import stage_of

Found = tuple[tuple[ProductSettings, ...], list[tuple[str, str, str]]]


def read(text: str, settings: RenderSettings | None = None) -> Found:
    """Products and the diagnostics as (code, prim path, attribute)."""
    diagnostics = Diagnostics()
    found = products(stage_of(text), settings, diagnostics)
    return found, [(d.code, d.prim_path, d.attribute) for d in diagnostics]


def settings_prim(body: str = "", name: str = "settings") -> str:
    return f'def RenderSettings "{name}"\n{{\n{body}\n}}\n'
