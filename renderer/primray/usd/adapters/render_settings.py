"""UsdRenderSettings and its first product: resolution, camera, purposes, aspect policy; the rest is noted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import Usd

from ...diagnostics import Diagnostics


@dataclass(frozen=True)
class StageSettings:
    """What the stage asks of a render; the defaults are UsdRenderSettingsBase's, or None where nothing is authored."""

    camera: str | None = None
    resolution: tuple[int, int] | None = None
    pixel_aspect_ratio: float = 1.0
    conform_policy: str = "expandAperture"
    purposes: tuple[str, ...] = ("default", "render")
    material_purposes: tuple[str, ...] = ("full", "")
    depth_of_field: bool = True


POLICIES = ("expandAperture", "cropAperture", "adjustApertureWidth", "adjustApertureHeight", "adjustPixelAspectRatio")


def render_settings(stage: Usd.Stage, candidates: list[Usd.Prim], diagnostics: Diagnostics) -> StageSettings:
    """By the stage's renderSettingsPrimPath, else its only RenderSettings prim (`candidates`), else the defaults."""
    prim = _choose(stage, candidates, diagnostics)
    if prim is None:
        return StageSettings()
    product = _product(stage, prim, diagnostics)
    path = str(prim.GetPath())
    resolution = _resolution(_inherited(prim, product, "resolution", authored_only=True), path, diagnostics)
    aspect = _inherited(prim, product, "pixelAspectRatio")
    if not isinstance(aspect, int | float) or not 0 < aspect < 1e6:
        diagnostics.add("render-settings-input", path, f"pixelAspectRatio = {aspect!r} is not a positive number: 1 is used.")
        aspect = 1.0
    policy = _inherited(prim, product, "aspectRatioConformPolicy")
    if policy not in POLICIES:
        diagnostics.add(
            "render-settings-input", path, f"aspectRatioConformPolicy = {policy!r} is unknown: expandAperture is used."
        )
        policy = "expandAperture"
    _note_ignored(prim, product, diagnostics)
    return StageSettings(
        _camera(prim, product),
        resolution,
        float(aspect),
        policy,
        tuple(str(p) for p in prim.GetAttribute("includedPurposes").Get() or ()),
        tuple("" if p == "allPurpose" else str(p) for p in prim.GetAttribute("materialBindingPurposes").Get() or ("",)),
        not _inherited(prim, product, "disableDepthOfField"),
    )


def _choose(stage: Usd.Stage, candidates: list[Usd.Prim], diagnostics: Diagnostics) -> Usd.Prim | None:
    if stage.HasAuthoredMetadata("renderSettingsPrimPath"):
        named = stage.GetMetadata("renderSettingsPrimPath")
        prim = stage.GetPrimAtPath(named) if named else None
        if prim and prim.GetTypeName() == "RenderSettings":
            return prim
        diagnostics.add("render-settings-input", str(named), "renderSettingsPrimPath leads to no RenderSettings prim.")
    if len(candidates) > 1:
        names = ", ".join(str(p.GetPath()) for p in candidates)
        diagnostics.add(
            "render-settings-input", "", f"None of several RenderSettings is named by the stage, so none is used: {names}."
        )
    return candidates[0] if len(candidates) == 1 else None


def _product(stage: Usd.Stage, settings: Usd.Prim, diagnostics: Diagnostics) -> Usd.Prim | None:
    """The first product, whose authored values override the settings' (UsdRenderSettingsBase)."""
    targets = settings.GetRelationship("products").GetForwardedTargets()
    products = [p for p in (stage.GetPrimAtPath(t) for t in targets) if p and p.GetTypeName() == "RenderProduct"]
    if not products:
        return None
    if len(products) > 1:
        diagnostics.add(
            "render-settings-input", str(settings.GetPath()), f"Only the first product, {products[0].GetPath()}, is rendered."
        )
    kind = products[0].GetAttribute("productType").Get()
    if kind != "raster":
        diagnostics.add("render-settings-input", str(products[0].GetPath()), f"productType = {kind} is rendered as raster.")
    return products[0]


def _inherited(settings: Usd.Prim, product: Usd.Prim | None, name: str, *, authored_only: bool = False) -> Any:
    if product is not None and product.GetAttribute(name).HasAuthoredValue():
        return product.GetAttribute(name).Get()
    attribute = settings.GetAttribute(name)
    return attribute.Get() if attribute.HasAuthoredValue() or not authored_only else None


def _resolution(raw: Any, path: str, diagnostics: Diagnostics) -> tuple[int, int] | None:
    if raw is None:
        return None
    width, height = int(raw[0]), int(raw[1])
    if width > 0 and height > 0:
        return (width, height)
    diagnostics.add("render-settings-input", path, f"resolution = ({width}, {height}) is ignored.")
    return None


def _camera(settings: Usd.Prim, product: Usd.Prim | None) -> str | None:
    for prim in (product, settings):
        targets = prim.GetRelationship("camera").GetForwardedTargets() if prim is not None else []
        if targets:
            return str(targets[0])
    return None


def _note_ignored(settings: Usd.Prim, product: Usd.Prim | None, diagnostics: Diagnostics) -> None:
    path = str(settings.GetPath())
    window = _inherited(settings, product, "dataWindowNDC")
    if window is not None and tuple(window) != (0.0, 0.0, 1.0, 1.0):
        diagnostics.add(
            "render-settings-input", path, f"dataWindowNDC = {tuple(window)} is ignored: the whole frame is rendered."
        )
    space = settings.GetAttribute("renderingColorSpace").Get()
    if space and space not in ("lin_rec709_scene", "lin_rec709"):
        diagnostics.add("render-settings-input", path, f"renderingColorSpace = {space} is ignored: linear Rec.709 is used.")
    variables = product.GetRelationship("orderedVars").GetForwardedTargets() if product is not None else []
    stage = settings.GetStage()
    for target in variables:
        var = stage.GetPrimAtPath(target)
        source = var.GetAttribute("sourceName").Get() if var and var.GetTypeName() == "RenderVar" else None
        if source is not None and source not in ("Ci", "C.*", "color", "rgb", "rgba", "RGBA", "LPE:C.*[LO]", ""):
            diagnostics.add("render-settings-input", str(target), f"The render variable {source} is not rendered, only colour.")
