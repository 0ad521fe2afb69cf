"""Facts about a stage's outputs: RenderSettings, their products with files and variables, and render passes."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pxr import Usd

from ...description.picture_file import PictureView
from ...diagnostics import Diagnostics
from ...errors import SettingsError
from ...settings import RenderSettings
from ...settings.stage_settings import StageSettings
from ..adapters.rendering.product_outputs import picture_ordered
from ..adapters.rendering.render_pass import settings_of_pass
from ..adapters.rendering.render_product import ProductSettings
from ..adapters.rendering.render_settings import products
from ..adapters.rendering.stage_settings import stage_settings
from ..stage.messages import scene_errors
from ..stage.reads import targets, type_name
from ..stage.traversal import world_prims
from ..stage.values import When, when_of_few

MOST = 500  # entries of each list


@scene_errors()
def output_facts(stage: Usd.Stage, settings: RenderSettings) -> dict[str, Any]:
    """Return the stage's RenderSettings and passes in order, and the products of the settings that a render uses."""
    prims = list(world_prims(stage))
    found = products(stage, settings, Diagnostics())
    followed = found[0].settings_path
    when = when_of_few(settings.time_code)
    return {
        "render_settings": [_settings(prim, followed, when) for prim in prims if type_name(prim) == "RenderSettings"][:MOST],
        "products": [_product(product, settings) for product in found if product.path][:MOST],
        "render_passes": [_pass(stage, prim) for prim in prims if type_name(prim) == "RenderPass"][:MOST],
    }


def _settings(prim: Usd.Prim, followed: str, when: When) -> dict[str, Any]:
    path = str(prim.GetPath())
    asked, view = stage_settings(prim, None, when, Diagnostics())
    products = [str(p) for p in targets(prim, "products")]
    return {"path": path, "followed": path == followed, "products": products, **_asked(asked, view)}


def _asked(asked: StageSettings, view: PictureView) -> dict[str, Any]:
    """Return the render settings and the view that a prim asks for, whether or not flags override them."""
    return {"asks": asked.as_json(), "view": None if view == PictureView() else asdict(view)}


def _product(product: ProductSettings, settings: RenderSettings) -> dict[str, Any]:
    return {
        "path": product.path,
        "product_name": product.name,
        "camera": product.camera,
        "resolution": list(product.resolution) if product.resolution else None,
        "picture": list(picture_ordered(product, settings)),
        **_asked(product.asked, product.file.view),
        "variables": [
            {
                "path": v.path,
                "name": v.name,
                "source": v.source_name or v.name,
                "source_type": v.source_type,
                "data_type": v.data_type,
            }
            for v in product.variables
        ],
    }


def _pass(stage: Usd.Stage, prim: Usd.Prim) -> dict[str, Any]:
    path = str(prim.GetPath())
    try:
        source = settings_of_pass(stage, path)
    except SettingsError:
        source = None
    return {"path": path, "render_settings": source}
