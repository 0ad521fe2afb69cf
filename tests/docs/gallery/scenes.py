"""What the gallery shows, in its order, and how each picture is made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FOLDER = ROOT / "docs/gallery"


@dataclass(frozen=True)
class Shown:
    """One picture: of `stage`, until its relative squared error is `target`, or after `spp` samples a pixel."""

    name: str
    title: str
    text: str
    target: float
    spp: int  # at most
    denoised: bool = False
    frame: float | None = None
    exposure: float = 0.0
    resolution: tuple[int, int] = (960, 540)
    stage: str = ""

    @property
    def path(self) -> Path:
        return ROOT / (self.stage or f"scenes/gallery/{self.name}/scene.usda")

    @property
    def command(self) -> str:
        """What makes the record, typed in the repository."""
        words = [f"primray render {self.path.relative_to(ROOT)} -r {self.resolution[0]} {self.resolution[1]}"]
        words += [f"--frame {self.frame:g}"] if self.frame is not None else []
        words += [f"--target-error {self.target:g} --spp {self.spp}"]
        words += ["--denoise"] if self.denoised else []
        words += [f"--exposure {self.exposure:g}"] if self.exposure else []
        return " ".join([*words, f"-o {self.name}.exr -o {self.name}.jpg"])


SHOWN = (
    Shown(
        "interior",
        "A reading corner",
        "Afternoon sun and sky through two tall windows. The sky is sampled through portals, and what walls send on to each "
        "other is most of the light. Linen lets light through.",
        target=0.005,
        spp=1024,
        denoised=True,
        resolution=(1280, 720),
    ),
    Shown(
        "street",
        "A street at dusk",
        "Façades of nine modules, trees, lamps and cars, all point instances, coloured house by house; hundreds of lit windows "
        "are its lights, and puddles mirror them.",
        target=0.003,
        spp=512,
        denoised=True,
        exposure=0.6,
    ),
    Shown(
        "groom",
        "A groom",
        "A small shaggy beast of 23,386 hairs, lit from behind, beside a ball of yarn: cubic curves that are round tubes, "
        "with a hair model that follows light through them.",
        target=0.02,
        spp=256,
        denoised=True,
    ),
    Shown(
        "glass",
        "A still life of glass",
        "A goblet of wine, a carafe of water, cut crystal and coloured balls in low light. Photons bring what they gather on "
        "the table.",
        target=0.008,
        spp=512,
        denoised=True,
    ),
    Shown(
        "product",
        "A product shot",
        "A wristwatch between softboxes, in OpenPBR: a sunburst dial and a brushed case (anisotropic), a coated crystal (thin "
        "film), stitched leather and velvet (fuzz). The second one, out of focus, is an instance.",
        target=0.003,
        spp=512,
        denoised=True,
    ),
    Shown(
        "wax",
        "Wax, jade and milk glass",
        "Candles that their flames light from within, jade, pearls, and a globe of milk glass with a lamp inside: light walks "
        "through all of them.",
        target=0.006,
        spp=512,
        denoised=True,
    ),
    Shown(
        "attic",
        "Dust in an attic",
        "The sun shines through three roof windows into dust, a medium that fills a box without a surface; a lantern burns in "
        "it. Lights are sampled along each ray through the dust as well as at its vertices.",
        target=0.03,
        spp=512,
        denoised=True,
        exposure=0.5,
    ),
    Shown(
        "motion",
        "A wheel of lamps",
        "The shutter is open for a second, while the wheel turns by 6 degrees. Lamps that move are lights; cabins hang upright "
        "in a frame that turns; the stand and the pier keep still.",
        target=0.001,
        spp=512,
        denoised=True,
        frame=1.0,
    ),
    Shown(
        "sculpture",
        "A bronze and its cage",
        "Both are the same mesh of some hundred quads: the bronze is its Catmull-Clark surface, diced for the camera, the "
        "plaster its cage.",
        target=0.001,
        spp=1024,
    ),
    Shown(
        "cornell",
        "A Cornell box, and its error",
        "A ball of glass, whose light on the block comes by photons. Below it the standard error of each pixel, which is in "
        "every EXR.",
        target=0.001,
        spp=1024,
    ),
    Shown(
        "cse168",
        "The box of CSE 168",
        "The first project of the course: a white box, a point light and a sky that lights nothing. Direct light alone: "
        "little is left to chance.",
        target=0.0001,
        spp=256,
        resolution=(800, 600),
        stage="scenes/analytic/cse168_project1.usda",
    ),
)
NAMED = {shown.name: shown for shown in SHOWN}
