"""The EXR that a stage's product asks for: types of its variables, compression, header and names; what it loses is reported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.images.encoding import Encoding
from primray.images.image import faults_of_exr

BRIGHT = """
def Mesh "wall" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    float3[] primvars:big = [(1e6, 2, 3)] (interpolation = "constant")
    rel material:binding = </m>
}
def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (100000, 2, 0.5)
        token outputs:surface
    }
}
"""
CI = 'def RenderVar "beauty" { uniform string sourceName = "Ci"\n token dataType = "color3h" }'


def stage(variables: str = CI, product: str = "") -> Any:
    from pxr import Usd

    names = [line.split('"')[1] for line in variables.splitlines() if line.lstrip().startswith("def RenderVar")]
    ordered = ", ".join(f"</Render/{name}>" for name in names)
    text = f"""#usda 1.0
{BRIGHT}
def Scope "Render"
{{
    def RenderSettings "settings" {{ rel products = [</Render/product>]
    }}
    def RenderProduct "product"
    {{
        token productName = "picture.exr"
        rel orderedVars = [{ordered}]
        {product}
    }}
    {variables.replace(" }", chr(10) + "}")}
}}
"""
    made = Usd.Stage.CreateInMemory("product.usda")
    assert made.GetRootLayer().ImportFromString(text)
    return made


def rendered(made: Any, **values: Any) -> primray.Image:
    return primray.render(made, resolution=(16, 12), spp=2, progress=False, **values)


def parts_of(path: Path) -> dict[str, Any]:
    """The specs of a file's parts by their names."""
    import OpenImageIO as oiio

    file, found = oiio.ImageInput.open(str(path)), dict[str, Any]()
    assert file is not None
    while file.seek_subimage(len(found), 0):
        spec = file.spec()
        found[spec.get_string_attribute("oiio:subimagename", "rgba")] = spec
    file.close()
    return found


def types(spec: Any) -> dict[str, str]:
    return {name: str(spec.channelformat(number)) for number, name in enumerate(spec.channelnames)}


def codes(image: primray.Image) -> list[tuple[str, str]]:
    return [(d["code"], d["attribute"]) for d in image.report["diagnostics"]]


@pytest.mark.filterwarnings("ignore::primray.RenderWarning")
@pytest.mark.parametrize(
    ("variables", "halves"),
    [
        (CI, "RGB"),
        (CI.replace("color3h", "color4h"), "RGBA"),
        (CI.replace("color3h", "half"), "RGB"),
        (CI.replace("color3h", "color3f"), ""),
        (CI.replace('"color3h"', '"color3f"\n token driver:parameters:aov:format = "color3h"'), "RGB"),
        (CI.replace('"Ci"', '"C.*"\n token sourceType = "lpe"'), "RGB"),
        (CI.replace("Ci", "stderr"), "stderr"),
        (CI.replace("Ci", "a"), "A"),
        (CI.replace("color3h", "color3f") + "\n" + CI.replace("beauty", "again"), ""),  # the first decides
    ],
)
def test_the_picture_is_of_its_variables_type(variables: str, halves: str, tmp_path: Path) -> None:
    image = rendered(stage(variables))
    image.save(tmp_path / "a.exr")
    (spec,) = parts_of(tmp_path / "a.exr").values()
    wanted = {name: name.startswith("stderr") if halves == "stderr" else name in halves for name in spec.channelnames}
    assert types(spec) == {name: "half" if half else "float" for name, half in wanted.items()}


def test_what_halves_cannot_hold_is_counted_in_every_part(tmp_path: Path) -> None:
    variables = (
        CI + '\ndef RenderVar "big" { string sourceName = "big"\n token sourceType = "primvar"\n token dataType = "half3" }'
    )
    image = rendered(stage(variables))
    seen = int(np.isfinite(image.aovs["big"].values[..., 0]).sum() - (image.aovs["big"].values[..., 0] == 0).sum())
    told = sorted(fault.message.split(":")[0] for fault in faults_of_exr(image, Encoding()))
    assert told == ["R", "big.X of big"]
    assert any(f"{seen} values" in fault.message for fault in faults_of_exr(image, Encoding()))
    with pytest.warns(primray.RenderWarning, match="half-channels"):
        image.save(tmp_path / "a.exr")
    assert np.isinf(primray.read_image(tmp_path / "a.exr").pixels[..., 0]).any()
    assert not faults_of_exr(rendered(stage(CI.replace("color3h", "color3f"))), Encoding())


def test_a_merged_picture_and_a_pair_are_of_the_same_types(tmp_path: Path) -> None:
    from primray.checkpoints.checkpointing import Checkpointing
    from primray.checkpoints.merge import merge

    path = tmp_path / "s.usda"
    made = stage(CI, 'string driver:parameters:OpenEXR:compression = "piz"')
    made.GetRootLayer().Export(str(path))
    for name, samples in (("a", (0, 4)), ("b", (4, 8))):
        primray.render(
            path,
            resolution=(16, 12),
            sample_range=samples,
            progress=False,
            checkpointing=Checkpointing(tmp_path / f"{name}.prc"),
        )
    merged = merge([tmp_path / "a.prc", tmp_path / "b.prc"]).image
    with pytest.warns(primray.RenderWarning, match="half-channels"):
        merged.save(tmp_path / "m.exr")
    spec = parts_of(tmp_path / "m.exr")["rgba"]
    assert types(spec)["R"] == "half"
    assert spec.getattribute("compression") == "piz"


@pytest.mark.parametrize(
    ("parameter", "compression"),
    [
        ('string driver:parameters:OpenEXR:compression = "zips"', "zips"),
        ('token driver:parameters:openexr:compression = "rle"', "rle"),
        ('string driver:parameters:compression = "piz"', "piz"),
        ('string arnold:driver_exr:compression = "none"', "none"),
        (
            'string driver:parameters:OpenEXR:compression = "dwaa"\nfloat driver:parameters:OpenEXR:dwa_compression_level = 20',
            "dwaa:20",
        ),
    ],
)
def test_compression_is_the_products(parameter: str, compression: str, tmp_path: Path) -> None:
    crypto = 'def RenderVar "ids" { string sourceName = "crypto_object" }\ndef RenderVar "prim" { token dataType = "int" }'
    image = rendered(stage(crypto, parameter))
    image.save(tmp_path / "a.exr")
    specs = parts_of(tmp_path / "a.exr")
    found = {name: spec.getattribute("compression") for name, spec in specs.items()}
    name, _, level = compression.partition(":")
    assert found.pop("rgba") == name
    assert not level or specs["rgba"].getattribute("openexr:dwaCompressionLevel") == float(level)
    exact = "zip" if compression.startswith("dwa") else compression  # ids are never stored with losses
    assert len(found) >= 2
    assert set(found.values()) == {exact}
    again = primray.read_image(tmp_path / "a.exr")
    assert np.array_equal(again.aovs["prim"].values, image.aovs["prim"].values)


def test_a_header_has_what_the_product_says_and_no_more(tmp_path: Path) -> None:
    said = """
        string driver:parameters:artist = "Ada"
        string driver:parameters:OpenEXR:comment = "a take"
        int driver:parameters:OpenEXR:take = 7
        float driver:parameters:OpenEXR:tilt = 1.5
        float3 driver:parameters:OpenEXR:slate = (1, 2, 3)
        string driver:parameters:OpenEXR:chromaticities = "mine"
        string driver:parameters:OpenEXR:dataWindow = "mine"
        double[] driver:parameters:OpenEXR:curve = [1, 2, 3, 4, 5]
        bool driver:parameters:OpenEXR:multipart = false
        string driver:parameters:OpenEXR:compression = "best"
    """
    image = rendered(stage("", said))
    image.save(tmp_path / "a.exr")
    spec = parts_of(tmp_path / "a.exr")["rgba"]
    assert [spec.getattribute(name) for name in ("Artist", "take", "tilt")] == ["Ada", 7, 1.5]
    assert tuple(spec.getattribute("slate")) == (1, 2, 3)
    assert "a take" in {attribute.value for attribute in spec.extra_attribs}
    left = [attribute.rpartition(":")[2] for code, attribute in codes(image) if code == "output-parameter"]
    assert sorted(left) == ["chromaticities", "curve", "dataWindow", "multipart"]
    assert ("render-settings-input", "driver:parameters:OpenEXR:compression") in codes(image)
    assert len(spec.getattribute("chromaticities")) == 8


def test_names_and_prefixes_of_channels(tmp_path: Path) -> None:
    variables = """
def RenderVar "n" { string sourceName = "N"
 token dataType = "normal3h"
 string driver:parameters:aov:name = "shading normal"
 string driver:parameters:aov:channel_prefix = "nrm" }
def RenderVar "bare" { string sourceName = "albedo"
 string driver:parameters:aov:channel_prefix = "" }
def RenderVar "Z" { token dataType = "float"
 bool driver:parameters:aov:multiSampled = false
 float driver:parameters:aov:clearValue = 5
 string driver:parameters:aov:name = "depth of it" }
def RenderVar "far" { string sourceName = "P"
 token dataType = "double3" }
def RenderVar "count" { string sourceName = "Ci"
 token dataType = "int" }
"""
    variables = variables.replace('def RenderVar "Z" { token', 'def RenderVar "Z" { string sourceName = "depth"\n token')
    image = rendered(stage(variables))
    image.save(tmp_path / "a.exr")
    found = {name: spec.channelnames for name, spec in parts_of(tmp_path / "a.exr").items()}
    assert found["shading normal"] == ("nrm.X", "nrm.Y", "nrm.Z")
    assert found["bare"] == ("R", "G", "B")
    assert found["depth of it"] == ("depth of it",)
    assert ("output-parameter", "driver:parameters:aov:clearValue") in codes(image)
    assert ("output-parameter", "dataType") in codes(image)
    assert ("render-var", "dataType") in codes(image)


@pytest.mark.parametrize(
    ("compression", "level", "stored"),
    [("none", None, "none"), ("zips", None, "zips"), ("piz", None, "piz"), ("dwaa", 120.0, "dwaa"), ("dwab", None, "dwab")],
)
def test_the_user_chooses_before_the_product(compression: str, level: float | None, stored: str, tmp_path: Path) -> None:
    asked = """
        string driver:parameters:OpenEXR:compression = "rle"
        string driver:parameters:artist = "Ada"
        string driver:parameters:shot = "a010"
    """
    variables = 'def RenderVar "prim" { token dataType = "int" }\ndef RenderVar "N" { token dataType = "normal3h" }\n' + CI
    image = rendered(stage(variables, asked), aovs=None)
    with pytest.warns(primray.RenderWarning, match="half-channels"):
        image.save(tmp_path / "plain.exr", compression=compression, level=level, header={"artist": "Grace", "take": 3})
    specs = parts_of(tmp_path / "plain.exr")
    assert specs["rgba"].getattribute("compression") == stored
    assert specs["prim"].getattribute("compression") == ("zip" if stored.startswith("dwa") else stored)
    assert level is None or specs["rgba"].getattribute("openexr:dwaCompressionLevel") == level
    assert [specs["rgba"].getattribute(name) for name in ("Artist", "shot", "take")] == ["Grace", "a010", 3]
    image.save(tmp_path / "floats.exr", half=["none"])
    for name, spec in parts_of(tmp_path / "floats.exr").items():
        assert set(types(spec).values()) == ({"uint"} if name == "prim" else {"float"})


def test_flags_say_how_an_exr_is_stored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from primray.cli import run

    made = stage()
    made.GetRootLayer().Export(str(tmp_path / "s.usda"))
    command = ["render", str(tmp_path / "s.usda"), "--res", "8", "8", "--spp", "2", "-o"]
    out = str(tmp_path / "a.exr")
    flags = ["--compression", "dwab:30", "--metadata", "shot=a=b", "--metadata", "supervisor=me", "--half", "none"]
    assert run([*command, out, *flags]) == 0
    (spec,) = parts_of(Path(out)).values()
    assert [spec.getattribute(name) for name in ("compression", "shot", "supervisor")] == ["dwab", "a=b", "me"]
    assert spec.getattribute("openexr:dwaCompressionLevel") == 30
    capsys.readouterr()
    for flags in (
        ["--compression", "best"],
        ["--compression", "piz:3"],
        ["--compression", "zip:much"],
        ["--metadata", "nothing"],
        ["--metadata", "chromaticities=mine"],
        ["--metadata", "primray:samples=9"],
    ):
        assert run([*command, out, *flags]) == 2
        assert "exr-setting" in capsys.readouterr().err
        assert run([*command, str(tmp_path / "a.png"), *flags]) == 2
    assert run([*command, str(tmp_path / "a.png"), "--metadata", "a=b"]) == 2
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("name", "attributes"), [("picture.exr", []), ("", []), ("picture.png", ["comment", "compression"]), ("picture.rat", [])]
)
def test_what_is_said_of_a_product_that_is_no_exr_is_reported(name: str, attributes: list[str]) -> None:
    parameters = 'string driver:parameters:comment = "a take"\ntoken driver:parameters:compression = "zips"'
    made = stage(product=parameters)
    made.GetPrimAtPath("/Render/product").GetAttribute("productName").Set(name)
    found = [attribute.rpartition(":")[2] for code, attribute in codes(rendered(made)) if code == "output-parameter"]
    assert sorted(found) == attributes
