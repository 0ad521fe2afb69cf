"""UsdRender: which settings are followed, what products override, values that cannot be."""

from __future__ import annotations

import pytest
from pxr import UsdRender
from tests.unit.usd.render_settings.settings_text import read, settings_prim

from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd import ProductSettings, RenderVariable, translate

from ..usd_text import stage_of, translate_text


def only(text: str) -> ProductSettings:
    found, codes = read(text)
    assert (len(found), codes) == (1, [])
    return found[0]


# The schema's own defaults are what a prim without opinions says.


def test_defaults_are_the_schemas() -> None:
    stage = stage_of("")
    schema = UsdRender.Settings.Define(stage, "/settings")
    found = only(settings_prim())
    assert found.settings_path == "/settings"
    assert found.path == found.name == ""
    assert found.resolution == tuple(schema.GetResolutionAttr().Get())
    assert found.pixel_aspect_ratio == schema.GetPixelAspectRatioAttr().Get()
    assert found.conform_policy == schema.GetAspectRatioConformPolicyAttr().Get()
    assert found.data_window == tuple(schema.GetDataWindowNDCAttr().Get())
    assert found.disable_motion_blur == schema.GetDisableMotionBlurAttr().Get()
    assert found.instantaneous_shutter == schema.GetInstantaneousShutterAttr().Get()
    assert found.disable_depth_of_field == schema.GetDisableDepthOfFieldAttr().Get()
    assert found.purposes == tuple(schema.GetIncludedPurposesAttr().Get())
    assert found.material_purposes == tuple(schema.GetMaterialBindingPurposesAttr().Get())
    assert found.rendering_color_space is None
    var = UsdRender.Var.Define(stage, "/var")
    default = RenderVariable("/var", "var")
    assert default.data_type == var.GetDataTypeAttr().Get()
    assert default.source_name == var.GetSourceNameAttr().Get()
    assert default.source_type == var.GetSourceTypeAttr().Get()


def test_a_stage_without_settings() -> None:
    assert read("") == ((ProductSettings(),), [])
    assert ProductSettings().resolution is None


# Which settings.

THREE = settings_prim("uniform int2 resolution = (1, 1)", "a") + settings_prim("uniform int2 resolution = (2, 2)", "b")
META = '#usda 1.0\n(\n    upAxis = "Y"\n    renderSettingsPrimPath = "PATH"\n)\n'


def test_the_choice_of_settings() -> None:
    assert only(settings_prim("uniform int2 resolution = (3, 4)")).resolution == (3, 4)
    assert only(META.replace("PATH", "/b") + THREE).resolution == (2, 2)
    asked = RenderSettings(render_settings="/a")
    assert read(META.replace("PATH", "/b") + THREE, asked)[0][0].resolution == (1, 1)
    found, codes = read(THREE)
    assert (found, codes) == ((ProductSettings(),), [("render-settings-input", "", "renderSettingsPrimPath")])


@pytest.mark.parametrize("path", ["", "/nowhere", "/a.resolution", "not a path", "a", "/x"])
def test_metadata_that_lead_nowhere(path: str) -> None:
    text = META.replace("PATH", path) + settings_prim("uniform int2 resolution = (1, 1)", "a") + 'def Scope "x"\n{\n}\n'
    found, codes = read(text)
    assert found[0].resolution == (1, 1)
    assert codes == [("render-settings-input", "", "renderSettingsPrimPath")]


@pytest.mark.parametrize("path", ["", "/nowhere", "/a.resolution", "not a path", "a", "/camera"])
def test_settings_that_there_are_not(path: str) -> None:
    with pytest.raises(SettingsError, match=r"/a, /b") as error:
        translate_text(THREE + 'def Camera "camera"\n{\n}\n', RenderSettings(render_settings=path))
    assert (error.value.code, error.value.where) == ("unknown-render-settings", path)
    with pytest.raises(SettingsError, match="none"):
        translate_text("", RenderSettings(render_settings="/a"))


# Products.


@pytest.mark.conforms("RenderSettings.products", "RenderProduct.orderedVars")
def test_targets_that_are_no_products_or_variables() -> None:
    text = settings_prim("rel products = [</a>, </p>, </p/b>]", "settings") + 'def Scope "a"\n{\n}\n'
    text += 'def RenderProduct "p"\n{\n    rel orderedVars = [</a>, </p>, </missing>]\n}\n'
    found, codes = read(text)
    assert [product.path for product in found] == ["/p"]
    assert (
        codes == [("render-settings-input", "/settings", "products")] * 2 + [("render-settings-input", "/p", "orderedVars")] * 3
    )
    assert read(settings_prim("rel products = </settings>"))[0][0].path == ""


@pytest.mark.conforms("RenderSettingsBase.instantaneousShutter", "RenderSettingsBase.disableMotionBlur")
@pytest.mark.parametrize("name", ["instantaneousShutter", "disableMotionBlur"])
def test_instant_shutters(name: str) -> None:
    field = {"instantaneousShutter": "instantaneous_shutter", "disableMotionBlur": "disable_motion_blur"}[name]
    assert getattr(only(settings_prim(f"uniform bool {name} = 1")), field)
    text = settings_prim(f"rel products = </p>\nuniform bool {name} = 1")
    assert not getattr(only(text + f'def RenderProduct "p"\n{{\n    uniform bool {name} = 0\n}}\n'), field)


def test_cameras_by_forwarded_relationships_and_the_first_of_several() -> None:
    text = settings_prim("rel camera = </other.camera>") + settings_prim("rel camera = </eye>", "other")
    found, _ = read(text, RenderSettings(render_settings="/settings"))
    assert found[0].camera == "/eye"
    found, codes = read(settings_prim("rel camera = [</one>, </two>]"))
    assert (found[0].camera, codes) == ("/one", [("render-settings-input", "/settings", "camera")])


# Bad values: the schema's default, and a diagnostic that names the attribute.

BAD = {
    "uniform int2 resolution": ["(0, 5)", "(5, -1)"],
    "uniform string resolution": ['"640x480"'],
    "uniform float pixelAspectRatio": ["0", "-1", "nan", "inf", "1e30", "1e-38"],
    "uniform string pixelAspectRatio": ['"x"'],
    "uniform token aspectRatioConformPolicy": ['"stretch"', '""'],
    "uniform int aspectRatioConformPolicy": ["1"],
    "uniform float4 dataWindowNDC": ["(0, 0, 0, 1)", "(1, 1, 0, 0)", "(nan, 0, 1, 1)", "(0, 0, inf, 1)", "(0, 1, 1, 1)"],
    "uniform float dataWindowNDC": ["1"],
    "uniform string disableDepthOfField": ['"yes"'],
    "uniform string disableMotionBlur": ['"yes"'],
}


@pytest.mark.parametrize(("name", "text"), [(name, text) for name, texts in BAD.items() for text in texts])
def test_values_that_cannot_be(name: str, text: str) -> None:
    attribute = name.split()[-1]
    (found,), codes = read(settings_prim(f"{name} = {text}"))
    assert found == only(settings_prim())
    assert codes == [("render-settings-input", "/settings", attribute)]
    product = f'def RenderProduct "p"\n{{\n    {name} = {text}\n}}\n'
    assert read(settings_prim("rel products = </p>") + product)[1] == [("render-settings-input", "/p", attribute)]


@pytest.mark.conforms("RenderSettings.includedPurposes")
def test_purposes() -> None:
    found, codes = read(settings_prim('uniform token[] includedPurposes = ["default", "toy"]'))
    assert (found[0].purposes, codes) == (("default",), [("render-settings-input", "/settings", "includedPurposes")])
    found, codes = read(settings_prim("uniform token[] includedPurposes = []"))
    assert (found[0].purposes, codes) == ((), [("render-settings-input", "/settings", "includedPurposes")])
    ball = 'def Sphere "ball"\n{\n    uniform token purpose = "proxy"\n}\n'
    text = settings_prim('uniform token[] includedPurposes = ["proxy"]') + ball
    assert len(translate_text(ball)[0].shapes) == 0
    assert len(translate_text(text)[0].shapes) == 1
    assert len(translate_text(text, RenderSettings(purposes=("default",)))[0].shapes) == 0  # the user's choice wins


BOUND = """
def Sphere "ball" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel material:binding = </all>
    rel material:binding:preview = </preview>
    rel material:binding:full = </full>
}
"""


@pytest.mark.conforms("RenderSettings.materialBindingPurposes")
@pytest.mark.parametrize(
    ("purposes", "color"),
    [
        (None, 3),
        ('["full", ""]', 3),
        ('["preview"]', 2),
        ('["preview", "full"]', 2),
        ('[""]', 1),
        ('["allPurpose"]', 1),
        ("[]", 1.8),
    ],
)
def test_material_purposes(purposes: str | None, color: float) -> None:
    text = BOUND + settings_prim(f"uniform token[] materialBindingPurposes = {purposes}" if purposes else "")
    for number, name in enumerate(("all", "preview", "full"), 1):
        text += f"""
def Material "{name}"
{{
    token outputs:surface.connect = </{name}/shader.outputs:surface>
    def Shader "shader"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.{number}, 0, 0)
        token outputs:surface
    }}
}}
"""
    description = translate_text(text)[0]
    assert description.surfaces[0].diffuse_color[0] == pytest.approx(color / 10)


def test_no_material_purposes() -> None:
    codes = read(settings_prim("uniform token[] materialBindingPurposes = []"))[1]
    assert codes == [("render-settings-input", "/settings", "materialBindingPurposes")]


@pytest.mark.conforms("RenderVar.sourceType")
def test_source_types() -> None:
    text = settings_prim("rel products = </p>") + 'def RenderProduct "p"\n{\n    rel orderedVars = </v>\n}\n'
    text += 'def RenderVar "v"\n{\n    uniform token sourceType = "KIND"\n    uniform string sourceName = "st"\n}\n'
    for kind in ("raw", "primvar", "lpe", "intrinsic"):
        assert only(text.replace("KIND", kind)).variables == (RenderVariable("/v", "v", "color3f", "st", kind),)
    found, codes = read(text.replace("KIND", "magic"))
    assert (found[0].variables[0].source_type, codes) == ("raw", [("render-settings-input", "/v", "sourceType")])


PASS_PROPERTIES = {
    "passType": 'uniform token passType = "prman"',
    "command": 'uniform string[] command = ["render"]',
    "renderSource": "rel renderSource = </settings>",
    "inputPasses": "rel inputPasses = </other>",
    "fileName": "uniform asset fileName = @x.usda@",
    "collection:renderVisibility:includeRoot": "uniform bool collection:renderVisibility:includeRoot = 0",
    "collection:cameraVisibility:includeRoot": "uniform bool collection:cameraVisibility:includeRoot = 0",
    "collection:prune:includes": "rel collection:prune:includes = </ball>",
    "collection:matte:includes": "rel collection:matte:includes = </ball>",
}


@pytest.mark.conforms(*(f"RenderPass.{name}" for name in ("passType", "command", "inputPasses", "fileName")), state="diagnosed")
@pytest.mark.parametrize("name", PASS_PROPERTIES)
def test_render_passes_are_told_where_none_is_asked_for(name: str) -> None:
    diagnostics = translate(stage_of(f'def RenderPass "pass"\n{{\n    {PASS_PROPERTIES[name]}\n}}\n'), RenderSettings())[1]
    found = [(d.code, d.prim_path, d.attribute) for d in diagnostics if d.prim_path == "/pass"]
    assert found == [("render-settings-input", "/pass", ""), ("render-settings-input", "/pass", name)]
