"""Surfaces at the ends of their ranges and beyond, against the surface model's own quadrature in double precision."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from tests.statistics.surfaces.preview_surface import PreviewSurface, cosine_to_half, diffuse_directions, lobe_directions

from primray.description import Surface

from .lit_stages import Shown, bound, camera_at, dome, light, material, placed, prim, show, sphere

Measured = Callable[[str], None]

WHITE = "color3f inputs:diffuseColor = (1, 1, 1)"
TILTED = (
    "Mesh", "plate", "int[] faceVertexCounts = [4]", "int[] faceVertexIndices = [0, 1, 2, 3]",
    'uniform token subdivisionScheme = "none"', bound("m"),
)  # fmt: skip


def tilted(cosine: float, *more: str) -> str:
    """A plate seen along -z at this cosine."""
    size = max(5, 0.06 / cosine)  # it fills the picture
    c, s = size * cosine, size * math.sqrt(1 - cosine * cosine)
    points = f"point3f[] points = [(-5, {-c!r}, {-s!r}), (5, {-c!r}, {-s!r}), (5, {c!r}, {s!r}), (-5, {c!r}, {s!r})]"
    return prim(*TILTED, points, *more, apis=["MaterialBindingAPI"])


CLOSE = prim(
    "Camera", "camera", "float2 clippingRange = (0.0001, 1000)", 'token projection = "orthographic"',
    "float horizontalAperture = 1", "float verticalAperture = 1", placed(z=100.0),
)  # fmt: skip


def reflected(cosine: float, *inputs: str, spp: int = 1024) -> Shown:
    """Of a sky of 1."""
    return show(CLOSE, dome(), tilted(cosine), material("m", *inputs), spp=spp)


COSINES = (0.001, 0.013, 0.1, 0.25, 0.6, 1.0)
ROUGHNESSES = {"0": 0.0, "1e-4": 1e-4, "1e-3": 1e-3, "0.011": 0.011, "0.03": 0.03, "0.3": 0.3, "1": 1.0}


@pytest.mark.parametrize("metallic", [0, 1], ids=["dielectric", "metal"])
@pytest.mark.parametrize("roughness", ROUGHNESSES)
@pytest.mark.hard_case(
    "Materials", "roughness and kind: %s", expected="the quadrature's albedo to 1e-3, at cosines from 0.001 to 1",
    plain_float="alpha^4 is 0 in single precision below a roughness of 1e-5: 0 / 0",
)  # fmt: skip
def test_roughness(roughness: str, metallic: int, measured: Measured) -> None:
    surface = Surface("", diffuse_color=(1.0,) * 3, metallic=float(metallic), roughness=ROUGHNESSES[roughness])
    worst = 0.0
    for cosine in COSINES:
        found = reflected(
            cosine, WHITE, f"float inputs:roughness = {roughness}", f"float inputs:metallic = {metallic}", spp=4096
        )
        wanted = PreviewSurface(surface).albedo(cosine)
        assert abs(found.mean - wanted) < 6e-4 + 5 * found.noise
        assert found.pixels.max() < 1.1
        worst = max(worst, abs(found.mean - wanted))
    assert worst < 1e-3
    measured("within 0.001")


IORS = {"1": 1.0, "0.5": 0.5, "1.33": 1.33, "2": 2.0, "5": 5.0, "0": 0.0, "1e6": 1e6}


@pytest.mark.parametrize("ior", IORS)
@pytest.mark.hard_case("Materials", "ior %s", expected="the quadrature's albedo to 1e-3, at cosines from 0.001 to 1")
def test_ior(ior: str, measured: Measured) -> None:
    surface = Surface("", diffuse_color=(1.0,) * 3, roughness=0.3, ior=IORS[ior])
    worst = 0.0
    for cosine in COSINES:
        found = reflected(cosine, WHITE, "float inputs:roughness = 0.3", f"float inputs:ior = {ior}", spp=8192)
        difference = abs(found.mean - PreviewSurface(surface).albedo(cosine))
        assert difference < 6e-4 + 4 * found.noise
        worst = max(worst, difference)
    assert worst < 1e-3
    measured("within 0.001")


# What is authored, the codes it gives, and what it is rendered as.
BAD: dict[str, tuple[str, str, str]] = {
    "metallic 2": ("float inputs:metallic = 2", "out-of-range", "float inputs:metallic = 1"),
    "roughness -1": ("float inputs:roughness = -1", "out-of-range", "float inputs:roughness = 0"),
    "opacity -3": ("float inputs:opacity = -3", "out-of-range", "float inputs:opacity = 0"),
    "clearcoat 7": ("float inputs:clearcoat = 7", "out-of-range", "float inputs:clearcoat = 1"),
    "diffuseColor -1 and 10": (
        "color3f inputs:diffuseColor = (-1, 0.5, 10)", "out-of-range", "color3f inputs:diffuseColor = (0, 0.5, 1)",
    ),
    "diffuseColor nan": ("color3f inputs:diffuseColor = (nan, 1, 1)", "wrong-type", ""),
    "diffuseColor inf": ("color3f inputs:diffuseColor = (inf, 1, 1)", "wrong-type", ""),
    "emissiveColor nan": ("color3f inputs:emissiveColor = (nan, 1, 1)", "wrong-type", ""),
    "emissiveColor -1": (
        "color3f inputs:emissiveColor = (-1, 0, 0)", "out-of-range", "color3f inputs:emissiveColor = (0, 0, 0)",
    ),
    "emissiveColor 1e38": (
        "color3f inputs:emissiveColor = (1e38, 0, 0)", "out-of-range", "color3f inputs:emissiveColor = (1e30, 0, 0)",
    ),
    "ior -1": ("float inputs:ior = -1", "out-of-range", "float inputs:ior = 0"),
    "ior nan": ("float inputs:ior = nan", "wrong-type", ""),
    "ior inf": ("float inputs:ior = inf", "wrong-type", ""),
    "opacityThreshold nan": ("float inputs:opacityThreshold = nan", "wrong-type", ""),
}  # fmt: skip


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.hard_case("Materials", "%s", expected="the nearest value or the default, and a diagnostic")
def test_values_out_of_range(bad: str, measured: Measured) -> None:
    text, code, same = BAD[bad]
    found, wanted = reflected(0.6, text, spp=16), reflected(0.6, same, spp=16)
    np.testing.assert_array_equal(found.pixels, wanted.pixels)
    assert set(found.noted) == {code}
    assert not wanted.noted or "1e38" in bad  # 1e30 itself is above what single precision makes of it
    assert found.invalid_samples == 0
    measured(f"as {same.removeprefix('color3f inputs:').removeprefix('float inputs:') or 'the default'}; {code}")


@pytest.mark.parametrize("interpolation", ["constant", "vertex"])
@pytest.mark.hard_case("Materials", "displayColor -1 and 10: %s", expected="0 and 1, and a diagnostic")
def test_display_color_out_of_range(interpolation: str, measured: Measured) -> None:
    def of(color: str) -> Shown:
        colors = [color] * (4 if interpolation == "vertex" else 1)
        primvar = f'color3f[] primvars:displayColor = [{", ".join(colors)}] (interpolation = "{interpolation}")'
        return show(CLOSE, dome(), tilted(1.0, primvar).replace(bound("m"), ""), spp=4)

    found, wanted = of("(-1, 0.5, 10)"), of("(0, 0.5, 1)")
    np.testing.assert_array_equal(found.pixels, wanted.pixels)
    assert set(found.noted) == {"out-of-range"}
    measured("as those, out-of-range")


def transport(s: PreviewSurface, cosines: np.ndarray) -> np.ndarray:
    """(N, N): what radiance at each cosine comes to at each cosine after one scattering; between the nodes linear."""
    n = len(cosines)
    matrix = np.zeros((n, n))

    def add(row: int, cos_in: np.ndarray, weight: np.ndarray) -> None:
        x = np.interp(cos_in, cosines, np.arange(n))
        i = np.minimum(x.astype(int), n - 2)
        matrix[row] += np.bincount(i, weight * (i + 1 - x), n) + np.bincount(i + 1, weight * (x - i), n)

    cos_in, azimuth, weight = diffuse_directions()
    for row, mu in enumerate(cosines):
        cos_h = cosine_to_half(float(mu), cos_in, azimuth)
        base = s.diffuse * (1 - s.fresnel(cos_h)) * s.keep_diffuse(float(mu)) * s.keep_diffuse(cos_in)
        add(row, cos_in, weight * base)
        if s.alpha == 0:
            add(row, np.array([mu]), np.array([s.fresnel(float(mu))]))
        else:
            inwards, cos_h, share = lobe_directions(float(mu), s.alpha)
            add(row, inwards, share * s.fresnel(cos_h))
    return matrix


CLOSED = {
    "white, roughness 1": Surface("", diffuse_color=(1.0,) * 3, roughness=1.0),
    "white, roughness 0.3": Surface("", diffuse_color=(1.0,) * 3, roughness=0.3),
    "metal, roughness 0.3": Surface("", diffuse_color=(1.0,) * 3, roughness=0.3, metallic=1.0),
    "metal, roughness 1": Surface("", diffuse_color=(1.0,) * 3, roughness=1.0, metallic=1.0),
}


def closed(s: Surface, spp: int, depth: int) -> Shown:
    """The inside of a sphere that emits 0.01, from its centre: every pixel sees it head-on, so all estimate one number."""
    inputs = (WHITE, f"float inputs:roughness = {s.roughness!r}", f"float inputs:metallic = {s.metallic!r}")
    inside = material("m", *inputs, "color3f inputs:emissiveColor = (0.01, 0.01, 0.01)")
    return show(camera_at(0.0, 1.0), sphere("m"), inside, spp=spp, max_depth=depth)


def closed_by_quadrature(s: Surface, depth: int) -> float:
    """A sphere's chord meets it at equal angles, so radiance is a function of the cosine alone."""
    cosines = np.linspace(0.02, 1, 97) ** 1.5
    matrix = transport(PreviewSurface(s), cosines)
    total, last = np.full(len(cosines), 0.01), np.full(len(cosines), 0.01)
    for _ in range(depth):
        last = matrix @ last
        total = total + last
    return float(total[-1])


@pytest.mark.long
@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.hard_case(
    "Materials", "closed sphere of albedo 1, depth 1000: %s", expected="the quadrature's energy, to 1e-4 a scattering",
)  # fmt: skip
def test_closed_sphere(name: str, measured: Measured) -> None:
    found, wanted = closed(CLOSED[name], 4096, 1000), closed_by_quadrature(CLOSED[name], 1000)
    assert found.noise < 2e-3 * wanted
    # 1e-4 an albedo is 1e-4 times the number of scatterings of the sum.
    assert abs(found.mean - wanted) < 3 * found.noise + 1e-4 * wanted * wanted / 0.01
    measured(f"{found.mean / wanted:.3f} of it")


def test_closed_sphere_shallow() -> None:
    """The same after few scatterings, without noise to speak of."""
    s = CLOSED["white, roughness 0.3"]
    for depth in (1, 4):
        found = closed(s, 1024, depth)
        assert abs(found.mean - closed_by_quadrature(s, depth)) < 5 * found.noise + 1e-4 * 0.01 * (depth + 1)


LAMP = light("SphereLight", "float inputs:radius = 0.01", at=placed(x=0.5))


def lambert_room(albedo: float, spp: int, depth: int | None) -> Shown:
    """A closed sphere with a lamp: what it receives on average is pi r^2 L = 1e-4 pi."""
    room = prim("Sphere", "room", "double radius = 1", f"color3f[] primvars:displayColor = [({albedo}, {albedo}, {albedo})]")
    return show(camera_at(0.0, 1.0), room, LAMP, spp=spp, max_depth=depth)


@pytest.mark.hard_case("Materials", "closed Lambert sphere of albedo 1, depth 1000", expected="1000 times what a lamp gives")
def test_albedo_one(measured: Measured) -> None:
    found = lambert_room(1.0, 32, 1000)
    assert found.mean == pytest.approx(0.1, abs=5 * found.noise + 1e-4)
    measured(f"{found.mean / 1e-4:.0f} times it" if abs(found.mean / 0.1 - 1) > 0.02 else "1000 times it, to 2 %")


@pytest.mark.hard_case(
    "Materials", "closed Lambert sphere of albedo 0.998, no limit of depth", expected="a / (1 - a): roulette loses nothing"
)
def test_albedo_close_to_one(measured: Measured) -> None:
    """Beyond the 1024th scattering even lossless paths meet roulette; a fifth of this light comes from there."""
    found = lambert_room(0.998, 64, None)
    assert found.mean == pytest.approx(1e-4 * 0.998 / 0.002, abs=5 * found.noise)
    assert found.noise < 0.02 * found.mean
    measured("that, to 2 %")


@pytest.mark.hard_case("Materials", "closed Lambert sphere of albedo 0", expected="black beyond the lamp; one ray a sample")
def test_albedo_zero(measured: Measured) -> None:
    found = lambert_room(0.0, 64, 1000)
    assert np.median(found.gray) == 0
    assert found.image.report["rays_by_kind"]["scattered"] == 0
    assert found.image.report["rays_by_kind"]["shadow"] == 0
    measured("black, no scattered ray")


@pytest.mark.hard_case("Materials", "the camera in a closed lossless mirror, no limit of depth", expected="ends, black")
def test_caught_in_a_mirror(measured: Measured) -> None:
    metal = material("m", WHITE, "float inputs:metallic = 1", "float inputs:roughness = 0")
    found = show(camera_at(0.3, 1.0), sphere("m"), metal, spp=4, default_light=False)
    assert not found.pixels.any()
    assert found.image.report["rays"] / found.image.report["samples"] < 4000
    measured("black")


NORMALS = {
    "zero": "(0, 0, 0)",
    "nan": "(nan, 0, 1)",
    "straight down": "(0, 0, -1)",
    "below the surface": "(5, 0, -1)",
    "along the surface": "(1, 0, 0)",
    "80 degrees over": "(0.985, 0, 0.174)",
    "80 degrees away": "(-0.985, 0, 0.174)",
}


@pytest.mark.parametrize("name", NORMALS)
@pytest.mark.hard_case(
    "Materials", "a normal map: %s", expected="no pixel black or above 1 under a sky of 1; no light from behind",
    plain_float="black where the bent normal faces away from the viewer",
)  # fmt: skip
def test_bent_normals(name: str, measured: Measured) -> None:
    st = 'texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")'
    lowest, highest = np.inf, 0.0
    for roughness in (0.0, 0.5):
        bent = material("m", WHITE, f"float inputs:roughness = {roughness}", f"normal3f inputs:normal = {NORMALS[name]}")
        for cosine in (0.3, 1.0):
            found = show(CLOSE, dome(), tilted(cosine, st), bent, spp=256)
            lowest, highest = min(lowest, float(found.gray.min())), max(highest, found.mean)
        behind = light("SphereLight", "float inputs:radius = 1", "float inputs:intensity = 100", at=placed(z=-8.0))
        leak = show(CLOSE, behind, tilted(1.0, st), bent, spp=64)
        assert not leak.pixels.any()
    assert lowest > 0.05
    assert highest < 1.005
    measured("as the true normal" if lowest > 0.9 else f"{lowest:.1f} to {min(highest, 1):.1f}")
