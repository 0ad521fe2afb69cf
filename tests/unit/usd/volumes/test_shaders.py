"""Volume shaders: which convention is taken, in which unit, and which coefficients they have."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from tests.unit.usd.volumes.volume_text import grid, translated, volume_text, write

from primray.description import SceneDescription

SMOKE = volume_text({"density": "", "temperature": "", "color": ""}, bound="/Look")


def look(nodes: str, output: str = "mtlx:volume", shader: str = "volume") -> str:
    """A material whose output leads to one of the nodes."""
    return f'def Material "Look" {{ token outputs:{output}.connect = </Look/{shader}.outputs:out>\n{nodes} }}'


def node(name: str, kind: str, inputs: str) -> str:
    return f'def Shader "{name}" {{ uniform token info:id = "{kind}"\n{inputs}\ntoken outputs:out\n}}\n'


def render(folder: Path, material: str, **other: object) -> tuple[SceneDescription, list[str], list[str]]:
    values = np.linspace(0, 1, 512)
    write(
        folder, grid(values), grid(1000 + 4000 * values, name="temperature"), grid((0.2, 0.4, 0.8), name="color", kind="vec3s")
    )
    description, told, messages = translated(folder, SMOKE + material, **other)  # type: ignore[arg-type]
    return description, [code for code, _ in told], messages


DENSITY = node("density", "ND_geompropvalue_float", 'string inputs:geomprop = "density"')
SCALED = DENSITY + node(
    "scaled",
    "ND_multiply_vector3FA",
    "vector3f inputs:in1 = (3, 2, 1)\nfloat inputs:in2.connect = </Look/density.outputs:out>",
)
VOLUME = node("volume", "ND_volume", "token inputs:vdf.connect = </Look/vdf.outputs:out>")


def test_materialx_is_per_metre(tmp_path: Path) -> None:
    vdf = node(
        "vdf",
        "ND_anisotropic_vdf",
        "vector3f inputs:scattering.connect = </Look/scaled.outputs:out>\n"
        "vector3f inputs:absorption.connect = </Look/scaled.outputs:out>\nfloat inputs:anisotropy = 0.5",
    )
    description, told, messages = render(tmp_path, look(SCALED + vdf + VOLUME), meters_per_unit=0.01)
    (medium,) = description.media
    assert medium.extinction == pytest.approx((0.06, 0.04, 0.02))
    assert medium.albedo == pytest.approx((0.5, 0.5, 0.5))
    assert medium.anisotropy == 0.5
    assert medium.albedo_grid is None
    assert medium.grid.name == "density"
    assert told == ["volume-convention"]
    assert "MaterialX's volume is used: its rates are per metre, and a scene unit is 0.01 m" in messages[0]


def test_usd_readers_and_sums_of_closures(tmp_path: Path) -> None:
    reader = node("density", "UsdPrimvarReader_float", 'string inputs:varname = "density"').replace(
        "outputs:out", "outputs:result"
    )
    scaled = SCALED.replace(DENSITY, reader).replace("density.outputs:out", "density.outputs:result")
    nodes = scaled + node("absorbs", "ND_absorption_vdf", "vector3f inputs:absorption.connect = </Look/scaled.outputs:out>")
    for name, g in (("ahead", 0.8), ("back", -0.4)):
        nodes += node(
            name,
            "ND_anisotropic_vdf",
            f"vector3f inputs:scattering.connect = </Look/scaled.outputs:out>\nfloat inputs:anisotropy = {g}",
        )
    nodes += node(
        "mix",
        "ND_mix_vdf",
        "token inputs:fg.connect = </Look/ahead.outputs:out>\ntoken inputs:bg.connect = </Look/back.outputs:out>\n"
        "float inputs:mix = 0.25",
    )
    nodes += node(
        "vdf",
        "ND_add_vdf",
        "token inputs:in1.connect = </Look/absorbs.outputs:out>\ntoken inputs:in2.connect = </Look/mix.outputs:out>",
    )
    description, told, _ = render(tmp_path, look(nodes + VOLUME, "volume"))
    ahead, back = description.media
    assert (ahead.anisotropy, back.anisotropy) == (pytest.approx(0.8), pytest.approx(-0.4))
    assert ahead.extinction == pytest.approx((3.75, 2.5, 1.25))
    assert ahead.albedo == pytest.approx((0.2, 0.2, 0.2))
    assert back.extinction == pytest.approx((2.25, 1.5, 0.75))
    assert back.albedo == (1, 1, 1)
    assert ahead.grid is back.grid
    assert told == ["volume-convention"]


def test_a_graph_of_fields_is_baked(tmp_path: Path) -> None:
    nodes = DENSITY + node("color", "ND_geompropvalue_vector3", 'string inputs:geomprop = "color"')
    nodes += node("curve", "ND_power_float", "float inputs:in1.connect = </Look/density.outputs:out>\nfloat inputs:in2 = 2")
    nodes += node(
        "scatters",
        "ND_multiply_vector3FA",
        "vector3f inputs:in1.connect = </Look/color.outputs:out>\nfloat inputs:in2.connect = </Look/curve.outputs:out>",
    )
    nodes += node("vdf", "ND_anisotropic_vdf", "vector3f inputs:scattering.connect = </Look/scatters.outputs:out>")
    description, told, _ = render(tmp_path, look(nodes + VOLUME))
    (medium,) = description.media
    density = np.linspace(0, 1, 512).astype(np.float32).astype(np.float64)
    extinction = np.array(medium.extinction) * medium.grid.leaf_values[0][:, None]
    np.testing.assert_allclose(extinction, density[:, None] ** 2 * np.array([0.2, 0.4, 0.8]), rtol=1e-5, atol=1e-9)
    assert medium.albedo == pytest.approx((1, 1, 1))
    assert told == ["volume-convention"]


def test_coloured_extinction_that_varies_is_three_media(tmp_path: Path) -> None:
    nodes = DENSITY
    nodes += node("curve", "ND_power_float", "float inputs:in1.connect = </Look/density.outputs:out>\nfloat inputs:in2 = 2")
    inputs = "".join(f"float inputs:in{k}.connect = </Look/{name}.outputs:out>\n" for k, name in ((1, "density"), (2, "curve")))
    nodes += node("scatters", "ND_combine3_vector3", inputs + "float inputs:in3 = 0")
    same = inputs.replace("/curve", "/density")
    nodes += node("absorbs", "ND_combine3_vector3", same + "float inputs:in3 = 0")
    nodes += node(
        "vdf",
        "ND_anisotropic_vdf",
        "vector3f inputs:scattering.connect = </Look/scatters.outputs:out>\n"
        "vector3f inputs:absorption.connect = </Look/absorbs.outputs:out>",
    )
    description, told, _ = render(tmp_path, look(nodes + VOLUME))
    assert [medium.extinction for medium in description.media] == [(1, 0, 0), (0, 1, 0)]
    density = np.linspace(0, 1, 512)
    for medium, own in zip(description.media, (density, density**2), strict=True):
        np.testing.assert_allclose(medium.grid.leaf_values[0], density + own, rtol=1e-5)
        assert medium.albedo_grid is not None
        channel = 0 if medium.extinction[0] else 1
        albedo = medium.albedo_grid.leaf_values[0, 1:, channel]
        np.testing.assert_allclose(albedo, (own / (density + own + 1e-30))[1:], rtol=1e-5)
    assert told == ["volume-convention"]


def test_emission_of_black_bodies(tmp_path: Path) -> None:
    nodes = node("temperature", "ND_geompropvalue_float", 'string inputs:geomprop = "temperature"')
    nodes += node("hot", "ND_blackbody", "float inputs:temperature.connect = </Look/temperature.outputs:out>")
    nodes += node("edf", "ND_uniform_edf", "color3f inputs:color.connect = </Look/hot.outputs:out>")
    nodes += node("volume", "ND_volume", "token inputs:edf.connect = </Look/edf.outputs:out>")
    description, _, _ = render(tmp_path, look(nodes))
    assert not description.media
    (emission,) = description.volume_emissions
    cold, hot = emission.grid.leaf_values[0, [0, -1]]
    luminance = emission.grid.leaf_values[0] @ np.array([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose(luminance, 1, rtol=0.05)
    assert cold[2] == 0
    assert cold[0] > 3
    assert hot[2] > 0.6
    assert description.may_need_light


def test_arnolds_standard_volume(tmp_path: Path) -> None:
    volume = node(
        "volume",
        "arnold:standard_volume",
        "float inputs:density = 2\nfloat inputs:scatter = 0.5\ncolor3f inputs:scatter_color = (0.2, 0.4, 0.8)\n"
        "color3f inputs:transparent = (0.5, 0.25, 0.5)\nfloat inputs:transparent_depth = 4\n"
        'float inputs:scatter_anisotropy = 0.3\nstring inputs:emission_mode = "density"\nfloat inputs:emission = 3',
    )
    description, told, messages = render(tmp_path, look(volume, "arnold:volume"), meters_per_unit=0.01)
    (medium,), (emission,) = description.media, description.volume_emissions
    assert medium.extinction == pytest.approx((math.log(2) / 2, math.log(2), math.log(2) / 2))
    assert medium.albedo == pytest.approx((0.1, 0.2, 0.4))
    assert medium.anisotropy == pytest.approx(0.3)
    assert emission.emission == (6, 6, 6)
    assert emission.grid is medium.grid
    assert told == ["volume-convention"]  # nothing is approximated
    assert "per scene unit" in messages[0]


def test_arnolds_black_bodies(tmp_path: Path) -> None:
    volume = node("volume", "arnold:standard_volume", "float inputs:blackbody_intensity = 0")
    (emission,) = render(tmp_path, look(volume, "arnold:volume"))[0].volume_emissions
    assert emission.grid.width == 3
    np.testing.assert_allclose(emission.grid.leaf_values[0] @ np.array([0.2126, 0.7152, 0.0722]), 1, rtol=0.05)


def test_karmas_volume(tmp_path: Path) -> None:
    volume = node(
        "volume",
        "kma_volume",
        "color3f inputs:scattering.connect = </Look/scaled.outputs:out>\nfloat inputs:anisotropy = 0.1\n"
        "float inputs:extinction_modifier = 2",
    )
    description, told, messages = render(tmp_path, look(SCALED + volume))
    (medium,) = description.media
    assert medium.extinction == pytest.approx((3, 2, 1))
    assert medium.albedo == (1, 1, 1)
    assert told == ["material-input", "volume-convention"]
    assert "extinction_modifier" in messages[0]


def test_renderman(tmp_path: Path) -> None:
    volume = node(
        "volume",
        "PxrVolume",
        'string inputs:densityFloatPrimVar = "density"\ncolor3f inputs:diffuseColor = (0.5, 0.5, 0.5)\n'
        "float inputs:anisotropy = -0.2",
    )
    (medium,) = render(tmp_path, look(volume, "ri:volume"))[0].media
    assert (medium.extinction, medium.albedo, medium.anisotropy) == ((1, 1, 1), (0.5, 0.5, 0.5), pytest.approx(-0.2))


@pytest.mark.parametrize(
    ("nodes", "says"),
    [
        (node("volume", "acme_volume", ""), "acme_volume is not a supported volume shader"),
        (VOLUME + node("vdf", "ND_dielectric_bsdf", ""), "ND_dielectric_bsdf is not a volume distribution function"),
        (
            VOLUME
            + node("vdf", "ND_anisotropic_vdf", "vector3f inputs:scattering.connect = </Look/noise.outputs:out>")
            + node("noise", "ND_noise3d_vector3", ""),
            "ND_noise3d_vector3 cannot be evaluated at voxels",
        ),
    ],
)
def test_shaders_that_cannot_be_rendered(tmp_path: Path, nodes: str, says: str) -> None:
    description, told, messages = render(tmp_path, look(nodes))
    assert says in messages[told.index("shader-ignored")]
    assert [medium.albedo for medium in description.media] == [pytest.approx((0.18, 0.18, 0.18))]
    assert "Storm's convention" in messages[-1]


def test_coefficients_that_depend_on_no_field(tmp_path: Path) -> None:
    vdf = node("vdf", "ND_anisotropic_vdf", "vector3f inputs:scattering = (2, 2, 2)")
    description, told, messages = render(tmp_path, look(vdf + VOLUME))
    (medium,) = description.media
    extinction = medium.extinction[0] * medium.grid.leaf_values[0]
    np.testing.assert_array_equal(extinction, np.where(np.arange(512) > 0, 2, 0))
    assert told == ["material-input", "volume-convention"]
    assert "where the field density is not 0" in messages[0]


@pytest.mark.parametrize(
    ("output", "shader"),
    [
        (
            "kma:volume",
            SCALED.replace('"density"\n', '"smoke"\n')
            + node("volume", "kma_volume", "color3f inputs:scattering.connect = </Look/scaled.outputs:out>"),
        ),
        (
            "arnold:volume",
            node(
                "volume",
                "arnold:standard_volume",
                'string inputs:density_channel = "smoke"\nstring inputs:emission_mode = "none"',
            ),
        ),
        ("ri:volume", node("volume", "PxrVolume", 'string inputs:densityFloatPrimVar = "smoke"')),
    ],
)
def test_a_density_of_a_name_that_no_field_has(tmp_path: Path, output: str, shader: str) -> None:
    description, told, messages = render(tmp_path, look(shader, output))
    assert not description.media
    assert "volume-field" in told
    said = "Its shader reads the field smoke, which is none of its own (color, density, temperature): nothing of it is seen"
    assert said in messages[told.index("volume-field")]


def test_an_anisotropy_that_varies(tmp_path: Path) -> None:
    vdf = node(
        "vdf",
        "ND_anisotropic_vdf",
        "vector3f inputs:scattering = (2, 2, 2)\nfloat inputs:anisotropy.connect = </Look/density.outputs:out>",
    )
    description, told, _ = render(tmp_path, look(DENSITY + vdf + VOLUME))
    assert description.media[0].anisotropy == pytest.approx(0.5, abs=0.01)
    assert told.count("material-input") == 2


@pytest.mark.parametrize(
    ("inputs", "codes", "says"),
    [
        ('string inputs:emission_mode = "none"', ["volume-convention"], ""),
        ('string inputs:emission_mode = "none"\nfloat inputs:displacement = 1', ["volume-convention"], ""),
        (
            'string inputs:emission_mode = "none"\nfloat inputs:blackbody_contrast = 2',
            ["translated", "volume-convention"],
            "Not read: blackbody_contrast",
        ),
        ("float inputs:blackbody_intensity = 0.5", ["translated", "volume-convention"], "Approximated: blackbody_intensity"),
        (
            'string inputs:emission_mode = "channel"\nstring inputs:emission_channel = "heat"',
            ["material-input", "volume-convention"],
            "reads the field heat, which is none of its own (color, density, temperature): the shader's default is used",
        ),
        (
            'string inputs:emission_mode = "channel"\nstring inputs:emission_channel = "heat"\nfloat inputs:emission = 0',
            ["volume-convention"],
            "",
        ),
        (
            'string inputs:emission_mode = "blackbody"\nstring inputs:temperature_channel = "heat"',
            ["volume-convention"],
            "It emits nothing, as no field is its temperature_channel, heat",
        ),
        ('string inputs:temperature_channel = ""', ["volume-convention"], "no field is its temperature_channel"),
    ],
)
def test_what_is_reported_of_arnolds_volume(tmp_path: Path, inputs: str, codes: list[str], says: str) -> None:
    """Exact translations are none of the reports by which `--strict` refuses; what is approximated or absent is named."""
    volume = node("volume", "arnold:standard_volume", inputs)
    _, told, messages = render(tmp_path, look(volume, "arnold:volume"))
    assert told == codes
    assert says in " ".join(messages)


def test_inputs_that_karmas_volume_does_not_have(tmp_path: Path) -> None:
    volume = node("volume", "kma_volume", "color3f inputs:scattering = (1, 1, 1)\nfloat inputs:shadowscale = 2")
    _, told, messages = render(tmp_path, look(volume, "kma:volume"))
    assert "material-input" in told
    assert any("shadowscale of kma_volume has no effect" in message for message in messages)
