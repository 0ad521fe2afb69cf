"""The table of docs/blender.md: what arrives of a Blender scene, with what tests/contrib/blender holds beside Cycles.

`python -m tests.docs.measured.blender_table` rewrites it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tests.contrib.blender.expected import EXPECTED, Expected

PAGE = Path(__file__).resolve().parents[3] / "docs" / "blender.md"
BEGIN = "<!-- generated from tests/contrib/blender/expected.py by `make docs`: begin -->"
END = "<!-- generated from tests/contrib/blender/expected.py: end -->"


@dataclass(frozen=True)
class Row:
    """What Blender has, what it is here, and the scenes that measure it: (job, names), no names for all of a job."""

    what: str
    here: str
    job: str = ""
    names: tuple[str, ...] = ()

    def scenes(self) -> dict[str, Expected]:
        known = EXPECTED.get(self.job, {})
        return {name: known[name] for name in self.names or known}


WORLD_IMAGES = ("constant", "image", "image, strong", "image, turned", "image, tilted")
FLAT = ("perspective", "shifted", "portrait", "orthographic")
PLAIN = ("default", "rough", "metal", "specular level", "alpha", "sheen", "emission")
BY_ATTRIBUTE = "Volume Scatter by an attribute"
MOVING = ("an object", "a turn", "a shape", "instances", "the camera", "its start", "not of this object")
AS_PRINCIPLED = ("Diffuse BSDF", "Emission", "Mix Shader with Transparent BSDF")
ROWS = (
    Row("point, spot, area (all shapes, spread) and sun lamps; exposure, temperature, constants of their nodes",
        "UsdLux, with profiles for spread and the spot's edge", "lamps"),
    Row("world: colour, strength, environment texture with rotation", "a dome light", "worlds", WORLD_IMAGES),
    Row("world: any other nodes", "rendered into an image 1,024 pixels wide (note `world-baked`)", "worlds", ("other nodes",)),
    Row("cameras: perspective, orthographic, shift, sensor fit, clipping, depth of field with blades", "UsdGeomCamera",
        "cameras", FLAT),
    Row("panoramic cameras: equirectangular, fisheye", "a table of directions", "cameras",
        ("equirectangular", "fisheye", "equisolid")),
    Row("Principled BSDF: base colour, metallic, roughness, specular level, alpha, sheen, emission", "OpenPBR by MaterialX",
        "surfaces", PLAIN),
    Row("Principled BSDF: transmission",
        "its colour's root, as light meets it twice; a white ball in uniform light of 1 is 1.000 in both, of roughness 0.4 "
        "1.004 here and 0.994 in Cycles", "surfaces", ("transmission",)),
    Row("Principled BSDF: coat", "without darkening, over a base that reflects as in air", "surfaces", ("coat",)),
    Row("Principled BSDF: subsurface",
        "as the exporter writes it; a white ball in uniform light of 1 is 1.0 here, as it has to be, and 0.9 in Cycles",
        "surfaces", ("subsurface",)),
    Row("Principled BSDF: anisotropic", "roughness and anisotropy converted; the exporter's tangent turned by a quarter",
        "surfaces", ("anisotropic", "anisotropic, turned")),
    Row("Diffuse BSDF, Emission, Transparent BSDF mixed with another shader, Emission added to another shader",
        "as a Principled BSDF", "shaders", AS_PRINCIPLED),
    Row("Glass BSDF", "as a Principled BSDF that colours what it reflects outside, Cycles inside as well", "shaders",
        ("Glass BSDF",)),
    Row("Glossy BSDF", "as a metal, which is noted"),
    Row("other mixes", "one surface with mixed inputs, which is noted"),
    Row("instances by collections and geometry nodes", "point instancers: one copy of each shape", "instances"),
    Row("surfaces without a material", "a diffuse grey of 0.8, as in Blender"),
    Row("curves with a bevel, text, metaballs", "meshes; curves without a bevel are not drawn, as in Blender", "curves"),
    Row("hair of particles, hair curves", "curves with their widths and material, where the object that grows it is rendered",
        "hair", ("hair of particles",)),
    Row("OpenVDB volumes: Principled Volume, Volume Scatter; density by an attribute, Volume Info, products with numbers",
        "[MaterialX's volume](volumes.md)", "volumes", ("smoke", "smoke, scaled", "absorption colour", BY_ATTRIBUTE)),
    Row("black bodies by a grid of temperatures", "their colour and Stefan and Boltzmann's law, as in Cycles", "volumes",
        ("fire",)),
    Row("meshes with a volume: Principled Volume, Volume Absorption", "the shape filled", "volumes",
        ("a mesh that absorbs", "a mesh that scatters")),
    Row("Volume Coefficients, Emission, sums and mixes of volume shaders", "MaterialX's sums and products"),
    Row("phase functions", "Henyey and Greenstein's, and Mie's ([droplets](volumes.md#mist)); others are noted"),
    Row("emission of a grid that no attribute scales", "where the density is not 0; Cycles fills the blocks of the grid"),
    Row("the world's volume of grey density", "[fog](fog.md) without a top, which scatters at most 0.99", "volumes",
        ("the world's",)),
    Row("motion blur of objects, shapes, instances, cameras; shutter, position, and objects without it",
        "time samples as the shutter opens, is half open and closes, each an export", "motions", MOVING),
    Row("what changes its faces, curves or instances meanwhile", "without blur, which is noted", "motions",
        ("faces that change",)),
    Row("subdivision as the last modifier", "a subdivision surface"),
)  # fmt: skip


def table() -> str:
    """Return the table; what is measured and belongs to no row has one of its own."""
    shown = {(row.job, name) for row in ROWS for name in row.scenes()}
    others = [Row(name, "", job, (name,)) for job, names in EXPECTED.items() for name in names if (job, name) not in shown]
    lines = ["| Blender | here | primray / Cycles | pixels |", "|---|---|---|---|"]
    return "\n".join([*lines, *(_line(row) for row in (*ROWS, *others))])


def _line(row: Row) -> str:
    scenes = row.scenes()
    if not row.job:
        return f"| {row.what} | {row.here} | not measured | |"
    kinds = dict.fromkeys((one.mean, one.tolerance, one.each) for one in scenes.values())
    ratios, pixels = [], []
    for mean, tolerance, each in kinds:
        names = [name for name, one in scenes.items() if (one.mean, one.tolerance, one.each) == (mean, tolerance, each)]
        said = f" ({', '.join(names)})" if len(kinds) > 1 and (mean, tolerance, each) != next(iter(kinds)) else ""
        ratios.append(f"{1 + mean:.3f} ± {tolerance:.3f}{said}")
        pixels.append(f"{each:.2f}")
    count = f"; {len(scenes)} scenes" if len(scenes) > 1 else ""
    return f"| {row.what} | {row.here} | {', '.join(ratios)}{count} | {', '.join(pixels)} |"


def with_table(page: str) -> str:
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
