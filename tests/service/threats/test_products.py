"""A job for one of a scene's products, through HTTP: its camera and size, and what is said of one that there is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.service.threats.fates import fate

SCENE = (Path(__file__).parents[3] / "scenes/features/render-products/scene.usda").read_text()
FEW = {"stop": {"max_samples": 2}}


def test_a_job_renders_the_product_it_names(client: Any) -> None:
    found = fate(client, SCENE, settings=FEW | {"render_settings": "/Render/settings", "products": ["/Render/side"]})
    assert found.end == "succeeded", found.problem
    effective = found.job["effective_settings"]["settings"]
    assert (effective["product"], effective["camera"], effective["resolution"]) == ("/Render/side", "/side", [48, 48])
    assert found.job["settings"]["products"] == ["/Render/side"]


def test_a_product_that_is_not_there_is_named_with_those_that_are(client: Any) -> None:
    found = fate(client, SCENE, settings=FEW | {"products": ["/Render/none"]})
    assert found.end == "failed"
    assert "/Render/none" in found.said
    assert "/Render/side" in found.said


def test_render_settings_that_are_not_there(client: Any) -> None:
    found = fate(client, SCENE, settings=FEW | {"render_settings": "/Render/none"})
    assert found.end == "failed"
    assert "/Render/settings" in found.said
