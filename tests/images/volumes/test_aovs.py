"""What outputs beside the picture hold where volumes are seen: opacity, depth, masks, guides, light by its path."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.test_volumes import CAMERA, SKY, look
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

import primray
from primray.images.cryptomatte import hash_of

pytestmark = pytest.mark.filterwarnings("ignore")
SOURCES = ("crypto_object", "crypto_material", "crypto_asset")
EXTINCTION = (0.125, 0.25, 0.5)  # by the smoke; along the camera's rays it has a length of 8
WALL = """
def Mesh "Wall" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-99, -99, -20), (99, -99, -20), (99, 99, -20), (-99, 99, -20)]
    color3f[] primvars:displayColor = [(0.25, 0.5, 0.75)]
    uniform token subdivisionScheme = "none"
}
"""
SUN = 'def DistantLight "Sun" {\n    float inputs:angle = 0\n}\n'
# In front of a camera at (3.5, 3.5, 30): the faces are 24 and 32 from it.
BOX = """
def Cube "Box" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    double size = 8
    rel material:binding = </Filled>
    double3 xformOp:translate = (3.5, 3.5, 2)
    float3 xformOp:scale = (4, 4, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}
def Material "Filled" {
    token outputs:mtlx:volume.connect = </Filled/volume.outputs:out>
    def Shader "volume" {
        uniform token info:id = "ND_volume"
        token inputs:vdf.connect = </Filled/particles.outputs:out>
        token outputs:out
    }
    def Shader "particles" {
        uniform token info:id = "ND_anisotropic_vdf"
        float3 inputs:absorption = (ABSORPTION)
        float3 inputs:scattering = (SCATTERING)
        token outputs:out
    }
}
"""
FOG = """
def Xform "World" {
    float primray:fog:density = 0.05
    float primray:fog:top = 100
}
"""


def render(folder: Path, text: str, *aovs: str, spp: int = 16, default: str = "", **values: Any) -> primray.Image:
    path = folder / f"stage{len(list(folder.iterdir()))}.usda"
    first = f'    defaultPrim = "{default}"\n' if default else ""
    path.write_text(f'#usda 1.0\n(\n    upAxis = "Y"\n    metersPerUnit = 1\n{first})\n{SKY}{CAMERA}{text}')
    return primray.render(str(path), aovs=aovs, resolution=(16, 16), spp=spp, seed=3, progress=False, **values)


def smoke(folder: Path, scatter: float = 0.5, density: float = 1.0, **other: Any) -> str:
    """A cube of one density that fills more than the picture."""
    write(folder, grid(density, **other))
    shader = f"float inputs:scatter = {scatter}\ncolor3f inputs:transparent = (0.882497, 0.778801, 0.606531)"
    placed = """
    float3 xformOp:scale = (4, 4, 1)
    double3 xformOp:translate = (-10.5, -10.5, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
"""
    text = volume_text(None, placed, bound="/Look")
    return text + look(f"{shader}\nfloat inputs:transparent_depth = 1")


def mean(aov: Any) -> Any:
    return aov.values.reshape(-1, aov.values.shape[2]).mean(axis=0, dtype=np.float64)


def masks(aov: Any) -> dict[int, Any]:
    ids, shares = np.ascontiguousarray(aov.values[..., 0::2]).view(np.uint32), aov.values[..., 1::2]
    return {int(n): np.where(ids == n, shares, 0).sum(axis=2) for n in np.unique(ids[shares > 0])}


def test_opacity_and_depth_of_smoke(tmp_path: Path) -> None:
    image = render(tmp_path, smoke(tmp_path) + WALL, "volume_opacity", "volume_depth", "depth", "prim")
    passes = np.exp(-8 * np.array(EXTINCTION))
    np.testing.assert_allclose(mean(image.aovs["volume_opacity"]), 1 - passes, atol=0.015)
    # The smoke lies 22 to 30 before the camera, which it leaves along a straight ray.
    t = np.linspace(0, 8, 4001)
    density = np.array(EXTINCTION) * np.exp(-t[:, None] * np.array(EXTINCTION))
    weights = density.mean(axis=1)
    expected = 30 - 7.5 + (t * weights).sum() / weights.sum()
    assert mean(image.aovs["volume_depth"])[0] == pytest.approx(expected, abs=0.1)
    assert (image.aovs["depth"].values == 50).all()  # that of the first surface
    assert set(image.aovs["prim"].ids.values()) == {"/Wall"}


@pytest.mark.parametrize("scattering", [0.0, 0.25])
def test_opacity_and_depth_of_a_filled_shape(tmp_path: Path, scattering: float) -> None:
    text = BOX.replace("ABSORPTION", ", ".join(str(e - scattering / 2) for e in EXTINCTION))
    text = text.replace("SCATTERING", ", ".join([str(scattering / 2)] * 3))
    image = render(tmp_path, text, "volume_opacity", "volume_depth", "depth", "crypto_object", spp=64)
    passes = np.exp(-8 * np.array(EXTINCTION))
    np.testing.assert_allclose(mean(image.aovs["volume_opacity"]), 1 - passes, rtol=1e-4)
    assert 24 < mean(image.aovs["volume_depth"])[0] < 28
    assert np.isinf(image.aovs["depth"].values).all()
    found = masks(image.aovs["crypto_object"])
    assert set(found) == {hash_of("/Box")}
    np.testing.assert_allclose(found[hash_of("/Box")], image.pixels[..., 3], atol=1e-6)
    assert found[hash_of("/Box")].mean() == pytest.approx(1 - passes.mean(), abs=0.02)


def test_opacity_of_fog(tmp_path: Path) -> None:
    image = render(tmp_path, FOG + WALL, "volume_opacity", "volume_depth", "crypto_object", default="World", spp=64)
    opacity = 1 - np.exp(-0.05 * 50)
    np.testing.assert_allclose(mean(image.aovs["volume_opacity"]), opacity, rtol=1e-4)
    expected = 20 * (1 - 2.5 * np.exp(-2.5) / opacity)
    assert mean(image.aovs["volume_depth"])[0] == pytest.approx(expected, abs=0.5)
    found = masks(image.aovs["crypto_object"])
    assert set(found) == {hash_of("/Wall"), hash_of("fog")}
    assert found[hash_of("fog")].mean() == pytest.approx(opacity, abs=0.02)


@pytest.mark.parametrize("scatter", [0.0, 0.5])
def test_masks_are_shares_of_the_collisions(tmp_path: Path, scatter: float) -> None:
    image = render(tmp_path, smoke(tmp_path, scatter, 0.5), *SOURCES, spp=64)
    plain = render(tmp_path, smoke(tmp_path, scatter, 0.5), spp=64)
    np.testing.assert_array_equal(image.pixels, plain.pixels)
    for source, name in zip(SOURCES, ("/Smoke", "/Look", "/Smoke"), strict=True):
        found = masks(image.aovs[source])
        assert set(found) == {hash_of(name)}
        # The collisions are those of the picture, so that no pixel has any other share.
        np.testing.assert_allclose(found[hash_of(name)], image.pixels[..., 3], atol=1e-6)
    counted = found[hash_of("/Smoke")] * 64
    np.testing.assert_allclose(counted, np.rint(counted), atol=1e-4)


def test_masks_before_a_surface_and_behind_one(tmp_path: Path) -> None:
    text = smoke(tmp_path)
    image = render(tmp_path, text + WALL, "crypto_object", spp=64)
    found = masks(image.aovs["crypto_object"])
    assert set(found) == {hash_of("/Wall"), hash_of("/Smoke")}
    passes = np.exp(-8 * np.array(EXTINCTION)).mean()
    assert found[hash_of("/Wall")].mean() == pytest.approx(passes, abs=0.02)
    np.testing.assert_allclose(sum(found.values()), 1, atol=1e-6)
    image = render(tmp_path, text + WALL.replace("-20)", "20)"), "crypto_object", "volume_opacity")
    assert set(masks(image.aovs["crypto_object"])) == {hash_of("/Wall")}
    assert not image.aovs["volume_opacity"].values.any()


def test_guides_mix_the_smoke_and_what_is_behind(tmp_path: Path) -> None:
    image = render(tmp_path, smoke(tmp_path) + WALL, "guide_albedo", "guide_normal", "albedo", "emission")
    passes = np.exp(-8 * np.array(EXTINCTION))
    share = passes.mean()
    # The albedo is scatter times scatter_color, each one half.
    expected = 0.25 * (1 - passes) + share * np.array([0.25, 0.5, 0.75])
    for name in ("guide_albedo", "albedo"):
        np.testing.assert_allclose(mean(image.aovs[name]), expected, atol=0.03)
    np.testing.assert_allclose(mean(image.aovs["guide_normal"]), [0, 0, share], atol=0.015)
    sky = render(tmp_path, smoke(tmp_path), "emission")
    np.testing.assert_allclose(mean(sky.aovs["emission"]), share, atol=0.02)


def test_light_paths_of_volumes_have_names(tmp_path: Path) -> None:
    names = ("volume", "volume_direct", "volume_indirect", "CV.*", "CVL", "C[LO]")
    write(tmp_path, grid(0.25), grid((0.1, 0.2, 0.3), name="emission", kind="vec3s"))
    image = render(tmp_path, volume_text({"density": "", "emission": ""}) + SUN + WALL, *names, spp=16)
    np.testing.assert_array_equal(image.aovs["volume"].values, image.aovs["CV.*"].values)
    np.testing.assert_array_equal(image.aovs["volume_direct"].values, image.aovs["CVL"].values)
    parts = image.aovs["volume_direct"].values.astype(np.float64) + image.aovs["volume_indirect"].values
    np.testing.assert_allclose(parts, image.aovs["volume"].values, rtol=1e-5, atol=1e-7)
    assert (mean(image.aovs["volume_indirect"]) > 0).all()


def test_variables_may_have_the_names_of_other_renderers(tmp_path: Path) -> None:
    wanted = ("volume_Z", "volume_opacity", "VolumeDir", "VolumeInd", "volume")
    variables = "\n".join(f'def RenderVar "{n}" {{\n        uniform string sourceName = "{n}"\n    }}' for n in wanted)
    ordered = ", ".join(f"</Render/{n}>" for n in wanted)
    text = f"""
def Scope "Render" {{
    {variables}
    def RenderProduct "product" {{
        rel orderedVars = [{ordered}]
    }}
    def RenderSettings "settings" {{
        rel products = </Render/product>
    }}
}}
"""
    path = tmp_path / "ordered.usda"
    path.write_text(f"#usda 1.0\n{SKY}{CAMERA}{smoke(tmp_path)}{text}")
    image = primray.render(str(path), resolution=(4, 4), spp=4, progress=False)
    assert set(image.aovs) == set(wanted)
    assert not [d for d in image.report["diagnostics"] if d["code"] == "render-var"]


def test_bits_do_not_depend_on_lanes_and_a_resume(tmp_path: Path) -> None:
    asked = ("crypto_object", "volume_opacity", "volume_depth", "guide_albedo")
    text = smoke(tmp_path) + BOX.replace("ABSORPTION", "0.1, 0.1, 0.1").replace("SCATTERING", "0.1, 0.2, 0.1") + WALL
    whole = render(tmp_path, text, *asked, spp=8)
    again = render(tmp_path, text, *asked, spp=8, threads=1)
    for name in asked:
        np.testing.assert_array_equal(whole.aovs[name].values, again.aovs[name].values)


PASS = """
def RenderPass "pass" {
    uniform bool collection:cameraVisibility:includeRoot = 1
    MEMBERS
}
"""
PASS_HIDDEN = PASS.replace("MEMBERS", "rel collection:cameraVisibility:excludes = </Smoke>")
PASS_MATTE = PASS.replace("MEMBERS", "rel collection:matte:includes = </Smoke>")
# Faces away from the camera, towards a sun that shines through the smoke.
FLOOR = WALL.replace("-20)", "-2)")


def passed(folder: Path, text: str, *aovs: str, **more: Any) -> primray.Image:
    return render(folder, text, *aovs, render_pass="/pass", **more)


@pytest.mark.parametrize("along", [True, False])
def test_a_render_pass_hides_smoke_from_the_camera(tmp_path: Path, along: bool) -> None:
    """Its shadow stays, whether or not lights are sampled along the rays; it is in no output."""
    lights = SUN if not along else SUN + 'def SphereLight "Lamp" {\ndouble3 xformOp:translate = (3.5, 3.5, 40)\n'
    lights += 'uniform token[] xformOpOrder = ["xformOp:translate"]\nfloat inputs:intensity = 1000\n}\n' if along else ""
    text = lights + FLOOR + smoke(tmp_path, 0.5)
    aovs = ("volume_opacity", "depth", "crypto_object", "volume_depth")
    hidden = passed(tmp_path, text + PASS_HIDDEN, *aovs, spp=256, max_depth=1)
    shown = render(tmp_path, text, *aovs, spp=256, max_depth=1)
    bare = render(tmp_path, lights + FLOOR, "depth", spp=256, max_depth=1)
    assert shown.aovs["volume_opacity"].values.max() > 0.5
    assert hidden.aovs["volume_opacity"].values.max() == 0
    np.testing.assert_array_equal(hidden.aovs["depth"].values, bare.aovs["depth"].values)
    assert (hidden.pixels[..., 3] == 1).all()
    # The wall has only what passes the smoke: of sun and sky, each of which the picture without it has in full.
    ratio = hidden.pixels[..., :3].mean(axis=(0, 1)) / bare.pixels[..., :3].mean(axis=(0, 1))
    assert (ratio < 0.9).all()
    assert ratio[0] > ratio[1] > ratio[2]


def test_smoke_that_is_a_matte_holds_out_what_is_behind_it(tmp_path: Path) -> None:
    """Of what is behind the smoke there is as much as it lets through, and nothing of the smoke itself."""
    text = SUN + WALL + smoke(tmp_path, 0.9)
    matte = passed(tmp_path, text + PASS_MATTE, spp=4096, max_depth=1)
    hidden = passed(tmp_path, text + PASS_HIDDEN, spp=64, max_depth=1)
    left = np.exp(-8 * np.array(EXTINCTION))
    ratio = matte.pixels[..., :3].mean(axis=(0, 1)) / hidden.pixels[..., :3].mean(axis=(0, 1))
    np.testing.assert_allclose(ratio, left, rtol=0.03, atol=0.001)
    assert matte.pixels[..., 3].mean() == pytest.approx(left.mean(), rel=0.03)


def test_fire_that_is_hidden_from_the_camera_still_shines(tmp_path: Path) -> None:
    fire = look('string inputs:emission_mode = "density"\nfloat inputs:density = 0.01\nfloat inputs:emission = 50')
    write(tmp_path, grid(1.0))
    text = volume_text(bound="/Look") + fire
    shown, hidden = (render(tmp_path, text + WALL), passed(tmp_path, text + WALL + PASS_HIDDEN))
    middle = np.s_[8, 8, 1]
    assert hidden.pixels[middle] < 0.5 * shown.pixels[middle]
    lit = passed(tmp_path, text + WALL + PASS_HIDDEN, spp=64).pixels[..., 1].mean()
    assert lit > 1.02 * render(tmp_path, WALL, spp=64).pixels[..., 1].mean()
