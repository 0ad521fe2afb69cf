"""Stages, and calls of `primray mcp` by the SDK's own client."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

STAGE = """#usda 1.0
(
    defaultPrim = "world"
    upAxis = "Z"
)
def Xform "world"
{
    def Cube "ground"
    {
        double size = 1
        color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
        double3 xformOp:scale = (20, 20, 0.1)
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }
    def Sphere "ball" (
        prepend apiSchemas = ["SemanticsLabelsAPI:class"]
    )
    {
        token[] semantics:labels:class = ["toy"]
        color3f[] primvars:displayColor = [(0.8, 0.1, 0.1)]
        double3 xformOp:translate = (-1.5, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Cube "box"
    {
        double size = 1.5
        color3f[] primvars:displayColor = [(0.1, 0.1, 0.8)]
        double3 xformOp:translate = (1.5, 0, 0.8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Camera "camera"
    {
        double3 xformOp:translate = (0, -12, 3)
        float3 xformOp:rotateXYZ = (80, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def DistantLight "sun"
    {
        float inputs:intensity = 3000
        float inputs:angle = 2
        float3 xformOp:rotateXYZ = (40, 10, 0)
        uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    }
}
"""


@dataclass(frozen=True)
class Answer:
    table: dict[str, Any]
    pictures: dict[str, bytes]
    text: str


def read(result: Any) -> Answer:
    """Return a tool's answer; pictures by the names before them."""
    texts = [item.text for item in result.content if item.type == "text"]
    assert not result.is_error, texts
    assert result.structured_content is None  # a picture there would be read as text
    pictures: dict[str, bytes] = {}
    for before, item in zip(result.content, result.content[1:], strict=False):
        if item.type == "image":
            pictures[before.text.split(",")[0]] = base64.b64decode(item.data)
    return Answer(json.loads(texts[0]), pictures, "\n".join(texts))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    found = tmp_path / "stages"
    found.mkdir()
    (found / "toys.usda").write_text(STAGE)
    return found
