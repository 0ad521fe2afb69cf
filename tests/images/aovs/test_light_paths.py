"""Light path expressions in pictures: closed forms, partitions to the bit, and groups of lights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.aovs.seen import stage_of

from primray import Image, render
from primray.checkpoints.checkpointing import Checkpointing
from primray.checkpoints.merge import merge
from primray.cli import run
from primray.core import passes
from primray.errors import CheckpointError
from primray.images.exr_parts import read_aovs
from primray.settings import RenderSettings

SIZE = (24, 18)
LOBES = ("C[LO]", "C<RD>[LO]", "C<RD>.+[LO]", "C<R[GS]>.*[LO]", "C<T.>.*[LO]", "CV.*[LO]")


def material(name: str, **inputs: str) -> str:
    lines = "\n".join(f"            {kind.replace('__', ' inputs:')} = {value}" for kind, value in inputs.items())
    return f"""
def Material "{name}"
{{
    token outputs:surface.connect = </{name}/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
{lines}
        token outputs:surface
    }}
}}
"""


def plane(name: str, z: float, half: float, of: str = "", more: str = "") -> str:
    bound = f"    rel material:binding = </{of}>\n" if of else ""
    api = 'prepend apiSchemas = ["MaterialBindingAPI"]' if of else ""
    corners = ", ".join(f"({x}, {y}, {z})" for x, y in ((-half, -half), (half, -half), (half, half), (-half, half)))
    return f"""
def Mesh "{name}" ({api})
{{
    point3f[] points = [{corners}]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
{bound}{more}}}
"""


def lamp(name: str, color: str = "(1, 1, 1)", more: str = "", place: str = "(0, 0, 8)") -> str:
    return f"""
def SphereLight "{name}"
{{
    float inputs:radius = 0.5
    float inputs:intensity = 20
    color3f inputs:color = {color}
    double3 xformOp:translate = {place}
    uniform token[] xformOpOrder = ["xformOp:translate"]
{more}}}
"""


GREY = material(
    "grey", color3f__diffuseColor="(0.6, 0.5, 0.4)", int__useSpecularWorkflow="1", color3f__specularColor="(0, 0, 0)"
)
MIRROR = material("mirror", color3f__diffuseColor="(1, 1, 1)", float__metallic="1", float__roughness="0")
PLASTIC = material("plastic", color3f__diffuseColor="(0.2, 0.4, 0.6)", float__roughness="0.3")
GLASS = material("glass", float__opacity="0", float__roughness="0", float__ior="1.5", color3f__diffuseColor="(0, 0, 0)")
GLOW = material("glow", color3f__emissiveColor="(2, 1, 0.5)", color3f__diffuseColor="(0, 0, 0)", float__roughness="0.5")
PANE = material("pane", float__opacity="0.5", token__opacityMode='"presence"', color3f__diffuseColor="(0.3, 0.3, 0.3)")


def picture(text: str, *aovs: str, light: str = "", spp: int = 16, **more: Any) -> Image:
    settings = RenderSettings(resolution=SIZE, spp=spp, seed=3, aovs=aovs, threads=1)
    return render(stage_of(text, light=light), replace(settings, **more), progress=False)


def colors(image: Image, name: str) -> np.ndarray:
    return image.aovs[name].values


def beauty(image: Image) -> np.ndarray:
    return image.pixels[..., :3]


def assert_adds_up(image: Image, *names: str) -> None:
    total = sum(colors(image, name).astype(np.float64) for name in names)
    assert np.array_equal(np.asarray(total).astype(np.float32), beauty(image))
    assert all((colors(image, name) >= 0).all() for name in names)


def test_a_diffuse_plane_under_a_lamp_is_all_direct_diffuse_light() -> None:
    image = picture(GREY + plane("floor", 0, 20, "grey") + lamp("lamp"), "C<RD>L", "C<R[GS]>.*", "C<RD>.+L", "CL", "C<T.>.*")
    assert beauty(image).min() > 0.01
    assert np.array_equal(colors(image, "C<RD>L"), beauty(image))
    assert not any(colors(image, name).any() for name in ("C<R[GS]>.*", "C<RD>.+L", "CL", "C<T.>.*"))


def test_a_mirror_shows_lamps_by_singular_reflection() -> None:
    image = picture(MIRROR + plane("floor", 0, 20, "mirror") + lamp("lamp"), "C<RS>L", "C<RG>.*", "CD.*")
    assert beauty(image).max() > 1
    assert np.array_equal(colors(image, "C<RS>L"), beauty(image))
    assert not colors(image, "C<RG>.*").any()
    assert not colors(image, "CD.*").any()


def test_what_is_seen_is_light_glow_or_background() -> None:
    text = GLOW + plane("screen", -2, 0.6, "glow") + lamp("lamp", place="(2.2, 0, -2)")
    image = picture(text, "CO", "CL", "CB", "C<..>.*[LO]", "C[LO]", light='def DomeLight "sky"\n{\n}\n', max_depth=1)
    seen, lamps, sky = (colors(image, name) for name in ("CO", "CL", "CB"))
    assert np.allclose(seen[9, 12], (2, 1, 0.5))
    assert (sky[0, 0] == 1).all()
    # The dome is a light as well.
    assert (lamps - sky).min() > -1e-6
    assert (lamps - sky).max() > 5
    assert_adds_up(image, "CO", "CL", "C<..>.*[LO]")
    assert_adds_up(image, "C[LO]", "C<..>.*[LO]")


def test_glass_is_reflection_and_refraction() -> None:
    ball = 'def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])\n{\n    rel material:binding = </glass>\n}\n'
    image = picture(GLASS + ball, "C<RS>B", "C<TS>{2}B", "C.{3,}B", "CB", light='def DomeLight "sky"\n{\n}\n', spp=64)
    middle = slice(8, 10), slice(11, 13)
    f = 0.04
    assert np.allclose(colors(image, "C<RS>B")[middle].mean(), f, atol=0.01)
    assert np.allclose(colors(image, "C<TS>{2}B")[middle].mean(), (1 - f) ** 2, atol=0.03)
    assert_adds_up(image, "C<RS>B", "C<TS>{2}B", "C.{3,}B", "CB")


@pytest.mark.parametrize("roughness", ["0.2", "0.6"])
def test_lobes_have_the_light_that_lamps_without_one_of_them_bring(roughness: str) -> None:
    """A light's multipliers leave out what it brings by diffuse or by other lobes: an expression must say the same."""
    shiny = material("shiny", color3f__diffuseColor="(0.2, 0.4, 0.6)", float__roughness=roughness, float__clearcoat="0.5")
    text = shiny + plane("floor", 0, 20, "shiny")
    both = picture(text + lamp("lamp"), "C<RD>L", "C<RG>L", spp=256, max_depth=1)
    assert_adds_up(both, "C<RD>L", "C<RG>L")
    for name, none in (("C<RD>L", "specular"), ("C<RG>L", "diffuse")):
        alone = picture(text + lamp("lamp", more=f"    float inputs:{none} = 0\n"), spp=256, max_depth=1)
        assert alone.errors is not None
        error = np.sqrt(np.mean(alone.errors**2) / alone.errors.size * 2)
        assert abs(colors(both, name).mean() - beauty(alone).mean()) < 5 * error + 1e-4 * beauty(alone).mean(), name


def test_indirect_light_has_the_lobe_that_it_left_the_first_surface_by() -> None:
    """Light of a ceiling that glows takes on the floor's colour by its diffuse lobe alone."""
    ceiling = plane("ceiling", 9, 12, "glow")
    image = picture(GLOW + PLASTIC + plane("floor", 0, 20, "plastic") + ceiling, "C<RD>O", "C<RG>O", spp=256, max_depth=1)
    assert_adds_up(image, "C<RD>O", "C<RG>O")
    diffuse, gloss = (colors(image, name)[6:12, 8:16].mean(axis=(0, 1)) for name in ("C<RD>O", "C<RG>O"))
    # Of glows 2 : 1 : 0.5, diffuse light takes on the surface's 0.2 : 0.4 : 0.6, gloss nothing.
    assert np.allclose(gloss / gloss[1], (2, 1, 0.5), rtol=0.03)
    assert np.allclose(diffuse / diffuse[1], (2 * 0.2 / 0.4, 1, 0.5 * 0.6 / 0.4), rtol=0.03)


def test_groups_of_lights_bring_what_they_bring_alone(tmp_path: Path) -> None:
    keys = lamp("a", "(0, 0, 1)", '    token karma:light:lpetag = "key"\n')
    keys += lamp("b", "(0, 1, 0)", '    string primvars:arnold:aov = "fill"\n', "(4, 0, 8)")
    keys += lamp("c", "(1, 0, 0)", '    string primvars:arnold:aov = "default"\n', "(-4, 0, 8)")
    sky = 'def DomeLight "sky"\n{\n    color3f inputs:color = (0, 0, 0.25)\n    string ri:light:lightGroup = "sky"\n}\n'
    names = ("C.*<L.'key'>", "C.*<L.'fill'>", "C.*<L.'sky'>", "C.*<L.[^'key''fill''sky']>", "C.*<L.'rim'>")
    floor = plane("floor", 0, 20, "plastic") + plane("wall", 2, 1, "grey")
    image = picture(PLASTIC + GREY + floor + keys, *names, light=sky)
    key, fill, dome, rest, none = (colors(image, name) for name in names)
    assert_adds_up(image, *names)
    assert not key[..., :2].any()
    assert not dome[..., :2].any()
    assert np.array_equal(fill[..., 1], beauty(image)[..., 1])
    assert np.array_equal(rest[..., 0], beauty(image)[..., 0])
    assert not none.any()
    [told] = [d for d in image.report["diagnostics"] if d["code"] == "light-group"]
    assert "'rim'" in told["message"]
    found = read_aovs(image.save(tmp_path / "a.exr"))
    assert list(found) == list(names)
    assert np.array_equal(found[names[0]].values, key)
    assert found[names[0]].channels == tuple(f"{names[0]}.{letter}" for letter in "RGB")


def test_collections_of_the_render_settings_are_groups() -> None:
    settings = """
def RenderSettings "settings" (prepend apiSchemas = ["CollectionAPI:lightGroup:key", "CollectionAPI:lightGroup:rest"])
{
    rel camera = </cam>
    rel collection:lightGroup:key:includes = </a>
    rel collection:lightGroup:rest:includes = </lamps>
}
def Scope "lamps"
{
"""
    lamps = lamp("a", "(0, 0, 1)", '    token karma:light:lpetag = "other"\n')
    text = GREY + plane("floor", 0, 20, "grey") + lamps + settings + lamp("b", "(1, 0, 0)") + "}\n"
    stage = stage_of(text, light="")
    stage.SetMetadata("renderSettingsPrimPath", "/settings")
    names = ("C.*<L.'key'>", "C.*<L.'rest'>")
    image = render(stage, RenderSettings(resolution=SIZE, spp=16, seed=3, aovs=names), progress=False)
    key, rest = (colors(image, name) for name in names)
    assert np.array_equal(key[..., 2], beauty(image)[..., 2])
    assert np.array_equal(rest[..., 0], beauty(image)[..., 0])
    assert not key[..., 0].any()
    assert not rest[..., 2].any()


def test_shapes_that_are_lights_have_groups() -> None:
    more = '    color3f inputs:color = (0, 1, 0)\n    string ri:light:lightGroup = "panel"\n'
    panel = plane("panel", 8, 1, more=more).replace('"panel" ()', '"panel" (prepend apiSchemas = ["MeshLightAPI"])')
    image = picture(GREY + plane("floor", 0, 20, "grey") + panel, "C.*<L.'panel'>", "C.*O")
    assert np.array_equal(colors(image, "C.*<L.'panel'>"), beauty(image))
    assert beauty(image).max() > 0
    assert not colors(image, "C.*O").any()


def test_light_straight_through_is_an_event_for_those_that_name_it() -> None:
    text = GREY + PANE + plane("floor", 0, 20, "grey") + plane("veil", 3, 20, "pane") + lamp("lamp", place="(0, 0, 4.5)")
    names = ("C<RD>L", "C<Ts><RD>L", "C<Ts><RD><Ts>L", "C<Ts>*<RD><Ts>*L")
    image = picture(text, *names, spp=64, max_depth=1)
    plain, into, both, any_way = (colors(image, name).mean() for name in names)
    assert plain == any_way > both > 0
    # Light from above the veil reaches the floor through it and is seen through it: never through one side alone.
    assert into == 0


SCENE = (
    GREY
    + PLASTIC
    + GLASS
    + GLOW
    + PANE
    + plane("floor", 0, 6, "grey")
    + plane("shelf", 1, 1.5, "plastic")
    + plane("veil", 2, 1, "pane")
    + plane("screen", 2.5, 0.3, "glow")
    + 'def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])\n{\n    rel material:binding = </glass>\n'
    + "    double radius = 0.6\n    double3 xformOp:translate = (1, 0.5, 2)\n"
    + '    uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    + lamp("lamp", more='    string ri:light:lightGroup = "key"\n')
)
SKY = 'def DomeLight "sky"\n{\n    float inputs:intensity = 0.3\n}\n'
NAMES = (*LOBES, "C.*", "C.*<L.'key'>", "C.*O", "C.*B", "C<Ts>+.*")


def test_expressions_change_no_bit_of_the_picture_and_add_up_to_it() -> None:
    image, without = picture(SCENE, *NAMES, light=SKY), picture(SCENE, light=SKY)
    assert np.array_equal(image.pixels, without.pixels)
    assert image.errors is not None
    assert without.errors is not None
    assert np.array_equal(image.errors, without.errors)
    assert image.report["rays"] == without.report["rays"]
    assert_adds_up(image, *LOBES)
    assert_adds_up(image, "C.*<L.'key'>", "C.*O", "C.*B")
    assert np.array_equal(colors(image, "C.*"), beauty(image))
    assert all(colors(image, name).any() for name in LOBES if "V" not in name)


def test_they_have_errors_on_request_by_which_they_are_compared(tmp_path: Path) -> None:
    names = ("C<RD>L", "C.*")
    image = picture(SCENE, *names, light=SKY, aov_errors=True)
    assert image.errors is not None
    whole, direct = image.aovs["C.*"].errors, image.aovs["C<RD>L"].errors
    assert whole is not None
    assert direct is not None
    assert np.array_equal(whole, image.errors)
    assert 0 < np.median(direct) < np.median(image.errors)
    files = []
    for seed, asked in ((1, True), (2, True), (3, False)):
        files.append(tmp_path / f"{seed}.exr")
        picture(SCENE, *names, light=SKY, aov_errors=asked, seed=seed, spp=64).save(files[-1])
    unchanged_or_undecided = (0, 6)
    assert run(["compare", str(files[0]), str(files[1]), "--aov", "all"]) in unchanged_or_undecided
    assert run(["compare", str(files[0]), str(files[2]), "--aov", "C<RD>L"]) == 2


def same(a: Image, b: Image) -> bool:
    return list(a.aovs) == list(b.aovs) and all(np.array_equal(colors(a, name), colors(b, name)) for name in a.aovs)


def test_neither_lanes_nor_threads_show(monkeypatch: pytest.MonkeyPatch) -> None:
    image = picture(SCENE, *NAMES, light=SKY, spp=8)
    assert same(image, picture(SCENE, *NAMES, light=SKY, spp=8, threads=3))
    for lanes in (1, 4):
        monkeypatch.setattr(passes, "lanes", lambda lanes=lanes: lanes)
        assert same(image, picture(SCENE, *NAMES, light=SKY, spp=8)), lanes


def test_checkpoints_and_merged_parts_have_them(tmp_path: Path) -> None:
    scene, names = stage_of(SCENE, light=SKY), NAMES
    whole = RenderSettings(resolution=SIZE, spp=16, seed=3, aovs=names)
    image = render(scene, whole, progress=False)
    first = Checkpointing(tmp_path / "a.prc")
    render(scene, replace(whole, spp=8), progress=False, checkpointing=first)
    again = render(scene, whole, progress=False, checkpointing=Checkpointing(tmp_path / "a.prc", resume=tmp_path / "a.prc"))
    assert same(again, image)
    parts = []
    for begin in (0, 8):
        parts.append(tmp_path / f"{begin}.prc")
        part = replace(whole, spp=None, sample_range=(begin, begin + 8))
        render(scene, part, progress=False, checkpointing=Checkpointing(parts[-1]))
    merged = merge(parts).image
    assert same(merged, image)
    assert "aovs-not-merged" not in [d["code"] for d in merged.report["diagnostics"]]
    with pytest.raises(CheckpointError, match="light paths is"):
        render(scene, replace(whole, aovs=()), progress=False, checkpointing=Checkpointing(parts[0], resume=parts[0]))
