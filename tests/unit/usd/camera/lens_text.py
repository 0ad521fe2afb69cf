"""Stages of one camera with a lens schema, translated."""

from __future__ import annotations

from typing import Any

from tests.unit.usd.usd_text import stage_of

from primray.description import Camera, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

Said = list[tuple[str, str]]


def translated(text: str, **settings: Any) -> tuple[SceneDescription, Said]:
    description, diagnostics = translate(stage_of(text), RenderSettings(**{"camera": "/eye", **settings}))
    return description, [(d.code, d.attribute) for d in diagnostics if d.prim_path == "/eye"]


def camera_of(body: str, schema: str = "", **settings: Any) -> tuple[Camera, Said]:
    applied = f'(prepend apiSchemas = ["{schema}"])' if schema else ""
    description, said = translated(f'def Camera "eye" {applied}\n{{\n{body}\n}}\n', **settings)
    return description.camera, said
