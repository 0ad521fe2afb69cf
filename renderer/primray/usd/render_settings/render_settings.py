"""Choice of the UsdRenderSettings of a render, and of its products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pxr import Sdf, Usd

from ...diagnostics import Diagnostics
from ...errors import SettingsError
from ...settings import RenderSettings
from ..stage.messages import scene_errors
from ..stage.metadata import render_settings_path
from ..stage.reads import targets, type_name
from ..stage.time_varying import is_below_clips
from ..stage.traversal import world_prims
from ..stage.values import When, when_of
from .render_pass import settings_of_pass
from .render_product import ProductSettings, read_product, read_settings_alone

LISTED = 20


@scene_errors()
def products(
    stage: Usd.Stage, settings: RenderSettings | None = None, diagnostics: Diagnostics | None = None
) -> tuple[ProductSettings, ...]:
    """Return all products of the RenderSettings that a render would use, in order; a default one if there are none.

    SettingsError if `settings` name RenderSettings that do not exist.
    """
    settings = settings or RenderSettings()
    diagnostics = Diagnostics() if diagnostics is None else diagnostics
    candidates = [prim for prim in world_prims(stage) if type_name(prim) == "RenderSettings"]
    prim = _choose(stage, _asked(stage, settings), candidates, diagnostics)
    found = _products(stage, prim, diagnostics)
    when = when_of(stage, settings.time_code, any(map(is_below_clips, (prim, *found))))
    return tuple(_read(prim, product, when, diagnostics) for product in found)


def product_settings(
    stage: Usd.Stage, settings: RenderSettings, candidates: Sequence[Usd.Prim], when: When, diagnostics: Diagnostics
) -> ProductSettings:
    """Return the settings of the requested product, else of the first. `candidates` are the stage's RenderSettings."""
    prim = _choose(stage, _asked(stage, settings), candidates, diagnostics)
    found = _products(stage, prim, diagnostics)
    if settings.product is not None:
        beside = [_read(prim, _named(path, found), when, diagnostics) for path in settings.joint_products or ()]
        return replace(_read(prim, _named(settings.product, found), when, diagnostics), beside=tuple(beside))
    if len(found) > 1:
        others = ", ".join(str(p.GetPath()) for p in found[1 : LISTED + 1] if p is not None)
        message = f"The first of {len(found)} products, {_path(found[0])}, is rendered; the others are {others}."
        diagnostics.add("product-chosen", _path(prim), message, "products")
    return _read(prim, found[0], when, diagnostics)


def _asked(stage: Usd.Stage, settings: RenderSettings) -> str | None:
    """Return the requested RenderSettings, else those of the requested render pass."""
    if settings.render_settings is not None or settings.render_pass is None:
        return settings.render_settings
    return settings_of_pass(stage, settings.render_pass)


def _choose(stage: Usd.Stage, asked: str | None, candidates: Sequence[Usd.Prim], diagnostics: Diagnostics) -> Usd.Prim | None:
    """Return the requested RenderSettings, else those named by the stage's metadata, else the only ones, else None."""
    if asked is not None:
        return _asked_for(stage, asked, candidates)
    named = render_settings_path(stage)
    if named is not None:
        prim = _at(stage, named)
        if prim is not None and type_name(prim) == "RenderSettings":
            return prim
        message = f"renderSettingsPrimPath names {named or 'nothing'}, which is not a RenderSettings prim: it is ignored."
        diagnostics.add("render-settings-input", "", message, "renderSettingsPrimPath")
    if len(candidates) > 1:
        names = ", ".join(str(p.GetPath()) for p in candidates[:LISTED])
        message = f"The stage names none of its {len(candidates)} RenderSettings, so none is used: {names}."
        diagnostics.add("render-settings-input", "", message, "renderSettingsPrimPath")
    return candidates[0] if len(candidates) == 1 else None


def _asked_for(stage: Usd.Stage, asked: str, candidates: Sequence[Usd.Prim]) -> Usd.Prim:
    prim = _at(stage, asked)
    if prim is not None and type_name(prim) == "RenderSettings":
        return prim
    listed = ", ".join(str(p.GetPath()) for p in candidates[:LISTED]) or "none"
    raise SettingsError(
        f"There are no RenderSettings {asked}; the stage's: {listed}.", where=asked, code="unknown-render-settings"
    )


def named_product(asked: str, paths: Sequence[str]) -> str:
    """Return the path of the product at this path or, if only one has it, of this name; SettingsError otherwise."""
    matching = [path for path in paths if path == asked] or [path for path in paths if path.rpartition("/")[2] == asked]
    if len(matching) == 1 and asked:
        return matching[0]
    listed = ", ".join(path for path in paths[:LISTED] if path) or "none"
    problem = f"Several products are called {asked}" if len(matching) > 1 else f"There is no product {asked}"
    raise SettingsError(f"{problem}; the products of the render settings: {listed}.", where=asked, code="unknown-product")


def _named(asked: str, targets: Sequence[Usd.Prim | None]) -> Usd.Prim:
    by_path = {_path(prim): prim for prim in targets if prim is not None}
    return by_path[named_product(asked, [*by_path])]


def _products(stage: Usd.Stage, settings: Usd.Prim | None, diagnostics: Diagnostics) -> list[Usd.Prim | None]:
    """Return the product prims, at least one entry; None is the default product."""
    if settings is None:
        return [None]
    found: list[Usd.Prim | None] = []
    for target in targets(settings, "products"):
        prim = _at(stage, target)
        if prim is not None and type_name(prim) == "RenderProduct":
            found.append(prim)
        else:
            message = f"products names {target}, which is not a RenderProduct: it is ignored."
            diagnostics.add("render-settings-input", _path(settings), message, "products")
    return found or [None]


def _read(settings: Usd.Prim | None, product: Usd.Prim | None, when: When, diagnostics: Diagnostics) -> ProductSettings:
    if settings is None:
        return ProductSettings()
    if product is None:
        return read_settings_alone(settings, when, diagnostics)
    return read_product(settings, product, when, diagnostics)


def _at(stage: Usd.Stage, path: object) -> Usd.Prim | None:
    text = str(path or "")
    if not Sdf.Path.IsValidPathString(text) or not Sdf.Path(text).IsAbsolutePath():
        return None
    return stage.GetPrimAtPath(Sdf.Path(text)) or None


def _path(prim: Usd.Prim | None) -> str:
    return str(prim.GetPath()) if prim is not None else ""
