"""Products inherit from their settings and override them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.unit.usd.render_settings.settings_text import read, settings_prim

from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd import ProductSettings, RenderVariable

from ..usd_text import translate_text

PRODUCTS = """
def RenderSettings "settings"
{
    rel products = [</p>, </q>]
    rel camera = </one>
    uniform int2 resolution = (100, 50)
    uniform float pixelAspectRatio = 2
    uniform token aspectRatioConformPolicy = "cropAperture"
    uniform float4 dataWindowNDC = (0.25, 0.25, 0.5, 0.5)
    uniform bool disableMotionBlur = 1
    uniform bool disableDepthOfField = 1
    uniform token[] includedPurposes = ["default", "proxy"]
    uniform token[] materialBindingPurposes = ["preview", "allPurpose"]
    uniform token renderingColorSpace = "lin_ap1_scene"
}
def RenderProduct "p"
{
}
def RenderProduct "q"
{
    token productName = "q.exr"
    rel camera = </two>
    uniform int2 resolution = (7, 9)
    uniform float pixelAspectRatio = 1
    uniform token aspectRatioConformPolicy = "expandAperture"
    uniform float4 dataWindowNDC = (0, 0, 1, 1)
    uniform bool disableMotionBlur = 0
    uniform bool disableDepthOfField = 0
    rel orderedVars = [</color>, </depth>]
}
def RenderVar "depth"
{
    uniform token dataType = "float"
    uniform string sourceName = "Z"
    uniform token sourceType = "intrinsic"
}
def RenderVar "color"
{
}
def Camera "one"
{
}
def Camera "two"
{
}
"""


OVERRIDDEN = (
    "camera",
    "resolution",
    "pixelAspectRatio",
    "aspectRatioConformPolicy",
    "dataWindowNDC",
    "disableMotionBlur",
    "disableDepthOfField",
)


@pytest.mark.conforms(
    *(f"RenderSettingsBase.{name}" for name in OVERRIDDEN),
    "RenderSettings.products",
    "RenderSettings.includedPurposes",
    "RenderSettings.materialBindingPurposes",
    "RenderProduct.productName",
    "RenderProduct.orderedVars",
)
def test_products_inherit_and_override() -> None:
    (p, q), codes = read(PRODUCTS)
    assert codes == []
    shared = ProductSettings(
        settings_path="/settings",
        purposes=("default", "proxy"),
        material_purposes=("preview", ""),
        rendering_color_space="lin_ap1_scene",
    )
    assert p == replace(
        shared,
        path="/p",
        camera="/one",
        resolution=(100, 50),
        pixel_aspect_ratio=2,
        conform_policy="cropAperture",
        data_window=(0.25, 0.25, 0.5, 0.5),
        disable_motion_blur=True,
        disable_depth_of_field=True,
    )
    variables = (RenderVariable("/color", "color"), RenderVariable("/depth", "depth", "float", "Z", "intrinsic"))
    assert q == replace(shared, path="/q", name="q.exr", camera="/two", resolution=(7, 9), variables=variables)


def test_the_product_that_is_rendered() -> None:
    def camera_of(product: str | None) -> str:
        return translate_text(PRODUCTS, RenderSettings(product=product))[0].camera.path

    assert (camera_of("/p"), camera_of("/q"), camera_of("q")) == ("/one", "/two", "/two")
    description, codes = translate_text(PRODUCTS)
    assert (description.camera.path, description.resolution) == ("/one", (100, 50))
    assert ("product-chosen", "/settings") in codes
    assert ("product-chosen", "/settings") not in translate_text(PRODUCTS, RenderSettings(product="/q"))[1]
    for odd in ("", "/settings", "r", "/r"):
        with pytest.raises(SettingsError, match=r"/p, /q") as error:
            camera_of(odd)
        assert (error.value.code, error.value.where) == ("unknown-product", odd)
    with pytest.raises(SettingsError, match="none"):
        translate_text("", RenderSettings(product="/p"))


@pytest.mark.conforms("RenderProduct.productType")
@pytest.mark.parametrize(("name", "kind", "reported"), [("a.exr", "deepRaster", False), ("a.png", "raster", True)])
def test_deep_rasters_are_exrs(name: str, kind: str, reported: bool) -> None:
    text = settings_prim("rel products = </p>") + (
        f'def RenderProduct "p"\n{{\n    uniform token productType = "deepRaster"\n    token productName = "{name}"\n}}\n'
    )
    found, codes = read(text)
    assert (found[0].type, codes) == (kind, [("render-settings-input", "/p", "productType")] if reported else [])


@pytest.mark.parametrize("kind", ["holograph", ""])
def test_other_product_types(kind: str) -> None:
    text = settings_prim("rel products = </p>") + f'def RenderProduct "p"\n{{\n    uniform token productType = "{kind}"\n}}\n'
    found, codes = read(text)
    assert (found[0].type, codes) == ("raster", [("render-settings-input", "/p", "productType")])
