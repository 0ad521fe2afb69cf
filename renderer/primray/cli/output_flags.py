"""Flags for the output of a command: files, their format, and how pictures look."""

from __future__ import annotations

from typing import Annotated

import typer

from ..settings import StopAt
from .option_values import ColorCorrection

Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="EXR, PNG, JPEG, TIFF or HDR; - is standard output (png:- a PNG there), or tev://HOST:PORT; may be repeated.",
        show_default="<scene>.exr",
    ),
]
Products = Annotated[
    list[str] | None,
    typer.Option(
        "--product",
        "--products",
        metavar="PRIM",
        help="Path or name of a RenderProduct, written under its own name; may be repeated.",
        show_default="the first",
    ),
]
AllProducts = Annotated[bool, typer.Option("--all-products", help="Every product of the RenderSettings, under its own name.")]
OutputDir = Annotated[
    str | None,
    typer.Option(
        "--output-dir",
        metavar="DIR",
        help="Where products with relative names are written; folders are made.",
        show_default="the current folder",
    ),
]
Record = Annotated[
    bool, typer.Option("--record", help="Products hold the picture and its standard errors, whether they order them or not.")
]
Aovs = Annotated[
    list[str] | None,
    typer.Option(
        "--aov",
        "--aovs",
        metavar="NAME",
        help="Outputs beside the picture, as parts of an EXR: names by commas, all, or none; may be repeated.",
        show_default="the stage's",
    ),
]
AovErrors = Annotated[
    bool, typer.Option("--aov-errors", help="Standard errors of AOVs that are means of samples, in their parts.")
]
View = Annotated[
    str | None,
    typer.Option("--view", metavar="NAME", help="OCIO view of PNG, JPEG and TIFF.", show_default="the display's default"),
]
Display = Annotated[
    str | None,
    typer.Option(
        "--display", metavar="NAME", help="OCIO display of PNG, JPEG and TIFF.", show_default="the configuration's default"
    ),
]
Look = Annotated[
    str | None,
    typer.Option(
        "--look", metavar="NAME", help="OCIO look of PNG, JPEG and TIFF, in place of the view's.", show_default="the view's"
    ),
]
Correction = Annotated[
    ColorCorrection | None,
    typer.Option("--colorCorrectionMode", "-color", help="In place of --view: Raw, Un-tone-mapped, or the default."),
]
MakeOutputPath = Annotated[bool, typer.Option("--make-output-path", help="Make the outputs' folders.")]
Snapshot = Annotated[
    float | None,
    typer.Option("--snapshot", metavar="S", help="Write the picture so far every so many seconds.", show_default=False),
]
Exposure = Annotated[
    str | None,
    typer.Option(
        "--exposure",
        metavar="STOPS",
        help="Of PNG, JPEG and TIFF; auto: as the view needs it, for all frames.",
        show_default="the product's, else 0",
    ),
]
Denoise = Annotated[
    bool | None,
    typer.Option(
        "--denoise/--no-denoise",
        help="A denoised picture beside the record, with its error; views show it (primray[denoise]).",
        show_default="the stage's, else not",
    ),
]
StopAtWhich = Annotated[
    StopAt, typer.Option("--stop-at", help="Whose error --target-error is of; denoised: as --denoise, at relmse or rmse.")
]
BitDepth = Annotated[
    int | None,
    typer.Option(
        "--bit-depth", metavar="N", help="Of PNG (8, 16) and TIFF (16, 8; 32: scene-linear floats).", show_default="8; TIFF 16"
    ),
]
Half = Annotated[
    list[str] | None,
    typer.Option(
        "--half",
        metavar="NAMES",
        help="Of an EXR, stored as halves: channels, layers, parts (R, stderr, rgba), all or none, by commas; may be repeated.",
        show_default="floats",
    ),
]
Compression = Annotated[
    str | None,
    typer.Option(
        "--compression",
        metavar="NAME[:LEVEL]",
        help="Of an EXR: none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa or dwab; a level of zip or DWA.",
        show_default="the product's, else zip",
    ),
]
Metadata = Annotated[
    list[str] | None,
    typer.Option("--metadata", metavar="NAME=VALUE", help="A further attribute of an EXR's header; may be repeated."),
]
Stereo = Annotated[
    bool,
    typer.Option(
        "--stereo",
        help="Both eyes of the camera's pair: two views of one EXR; PNG and JPEG get _left and _right, or %V and %v filled in.",
    ),
]
Diffusion = Annotated[
    float | None,
    typer.Option(
        "--diffusion",
        metavar="SHARE",
        help="Of all light that the lens diffuses, a further part of the EXR and what PNG and JPEG show; 0: none.",
        show_default="the camera's",
    ),
]
DiffusionGlare = Annotated[
    float | None,
    typer.Option("--diffusion-glare", metavar="SHARE", help="Of that, the veil's.", show_default="the camera's, else 0.2"),
]
DiffusionBloomWidth = Annotated[
    float | None,
    typer.Option(
        "--diffusion-bloom-width",
        metavar="SHARE",
        help="The bloom's, of the picture's height.",
        show_default="the camera's, else 0.005",
    ),
]
DiffusionStarburst = Annotated[
    float | None,
    typer.Option(
        "--diffusion-starburst",
        metavar="SHARE",
        help="Of what is diffused, the star's of the blades.",
        show_default="the camera's, else 0.3",
    ),
]
DiffusionStarburstWidth = Annotated[
    float | None,
    typer.Option(
        "--diffusion-starburst-width",
        metavar="SHARE",
        help="Wavelength over aperture, of the picture's height.",
        show_default="the camera's, else 0.003",
    ),
]
Report = Annotated[str | None, typer.Option("--report", metavar="FILE", help="Write the report as JSON.", show_default=False)]
SampleRange = Annotated[
    str | None,
    typer.Option(
        "--sample-range",
        metavar="A:B",
        help="Only these of each pixel's samples, for `primray merge`; multiples of 2.",
        show_default=False,
    ),
]
Checkpoint = Annotated[
    str | None,
    typer.Option("--checkpoint", metavar="FILE", help="Write what is needed to go on from there.", show_default=False),
]
CheckpointEvery = Annotated[
    float | None, typer.Option("--checkpoint-every", metavar="S", help="Seconds between checkpoints.", show_default="60")
]
Resume = Annotated[
    str | None,
    typer.Option("--resume", metavar="FILE", help="Go on from a checkpoint, and with it unless --checkpoint names another."),
]
Json = Annotated[bool, typer.Option("--json", help="JSON lines on stdout.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-V", help="Every diagnostic and prim; tracebacks of errors.")]
