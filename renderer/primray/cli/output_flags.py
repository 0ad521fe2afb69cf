"""Flags for the output of a command: files, their format, and how pictures look and are presented."""

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
        help="Output file: EXR, PNG, JPEG, TIFF or HDR; - for standard output (png:- for a PNG), or tev://HOST:PORT; "
        "may be repeated.",
        show_default="<scene>.exr",
    ),
]
Products = Annotated[
    list[str] | None,
    typer.Option(
        "--product",
        "--products",
        metavar="PRIM",
        help="Path or name of a RenderProduct to render to its own file; may be repeated.",
        show_default="the first",
    ),
]
AllProducts = Annotated[
    bool, typer.Option("--all-products", help="Render every product of the RenderSettings to its own file.")
]
OutputDir = Annotated[
    str | None,
    typer.Option(
        "--output-dir",
        metavar="DIR",
        help="Folder for products with relative file names; folders are created.",
        show_default="the current folder",
    ),
]
Record = Annotated[
    bool, typer.Option("--record", help="Add the picture and its standard errors to products that do not order them.")
]
Aovs = Annotated[
    list[str] | None,
    typer.Option(
        "--aov",
        "--aovs",
        metavar="NAME",
        help="AOVs to write as parts of an EXR: names separated by commas, all, or none; may be repeated.",
        show_default="the stage's",
    ),
]
AovErrors = Annotated[bool, typer.Option("--aov-errors", help="Add standard errors to AOVs that are means of samples.")]
View = Annotated[
    str | None,
    typer.Option("--view", metavar="NAME", help="OCIO view for PNG, JPEG and TIFF.", show_default="the display's default"),
]
Display = Annotated[
    str | None,
    typer.Option(
        "--display", metavar="NAME", help="OCIO display for PNG, JPEG and TIFF.", show_default="the configuration's default"
    ),
]
Look = Annotated[
    str | None,
    typer.Option(
        "--look", metavar="NAME", help="OCIO look for PNG, JPEG and TIFF, instead of the view's.", show_default="the view's"
    ),
]
Correction = Annotated[
    ColorCorrection | None,
    typer.Option(
        "--colorCorrectionMode",
        "-color",
        help="View by usdrecord's names, instead of --view: Raw, Un-tone-mapped, or the default.",
    ),
]
MakeOutputPath = Annotated[bool, typer.Option("--make-output-path", help="Create the folders of output files.")]
Snapshot = Annotated[
    float | None,
    typer.Option("--snapshot", metavar="S", help="Write the unfinished picture every S seconds.", show_default=False),
]
Exposure = Annotated[
    str | None,
    typer.Option(
        "--exposure",
        metavar="STOPS",
        help="Exposure of PNG, JPEG and TIFF; auto: computed from the first frame, for all frames.",
        show_default="the product's, else 0",
    ),
]
Denoise = Annotated[
    bool | None,
    typer.Option(
        "--denoise/--no-denoise",
        help="Add a denoised picture with its error; PNG and JPEG show it (needs primray[denoise]).",
        show_default="the stage's, else not",
    ),
]
StopAtWhich = Annotated[
    StopAt,
    typer.Option(
        "--stop-at", help="Picture that --target-error applies to; denoised implies --denoise and needs relmse or rmse."
    ),
]
BitDepth = Annotated[
    int | None,
    typer.Option(
        "--bit-depth",
        metavar="N",
        help="Bits per channel of PNG (8, 16) and TIFF (16, 8; 32: scene-linear floats).",
        show_default="8; TIFF 16",
    ),
]
Half = Annotated[
    list[str] | None,
    typer.Option(
        "--half",
        metavar="NAMES",
        help="Channels, layers or parts of an EXR to store as halves (R, stderr, rgba), all or none, separated by commas; "
        "may be repeated.",
        show_default="floats",
    ),
]
Compression = Annotated[
    str | None,
    typer.Option(
        "--compression",
        metavar="NAME[:LEVEL]",
        help="Compression of an EXR: none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa or dwab; level for zip or DWA.",
        show_default="the product's, else zip",
    ),
]
Metadata = Annotated[
    list[str] | None,
    typer.Option("--metadata", metavar="NAME=VALUE", help="Additional attribute of an EXR's header; may be repeated."),
]
Stereo = Annotated[
    bool,
    typer.Option(
        "--stereo",
        help="Render both eyes of the camera's stereo pair: two views in one EXR; PNG and JPEG get _left and _right, or %V and "
        "%v filled in.",
    ),
]
Diffusion = Annotated[
    float | None,
    typer.Option(
        "--diffusion",
        metavar="SHARE",
        help="Share of the light that the lens diffuses (0: none), shown by PNG and JPEG, and an additional part of an EXR.",
        show_default="the camera's",
    ),
]
DiffusionGlare = Annotated[
    float | None,
    typer.Option(
        "--diffusion-glare",
        metavar="SHARE",
        help="Share of the diffused light in veiling glare.",
        show_default="the camera's, else 0.2",
    ),
]
DiffusionBloomWidth = Annotated[
    float | None,
    typer.Option(
        "--diffusion-bloom-width",
        metavar="SHARE",
        help="Width of the bloom relative to the picture's height.",
        show_default="the camera's, else 0.005",
    ),
]
DiffusionStarburst = Annotated[
    float | None,
    typer.Option(
        "--diffusion-starburst",
        metavar="SHARE",
        help="Share of the diffused light in the starburst of the aperture blades.",
        show_default="the camera's, else 0.3",
    ),
]
DiffusionStarburstWidth = Annotated[
    float | None,
    typer.Option(
        "--diffusion-starburst-width",
        metavar="SHARE",
        help="Wavelength over aperture diameter, relative to the picture's height.",
        show_default="the camera's, else 0.003",
    ),
]
Report = Annotated[
    str | None, typer.Option("--report", metavar="FILE", help="Write the render report as JSON.", show_default=False)
]
SampleRange = Annotated[
    str | None,
    typer.Option(
        "--sample-range",
        metavar="A:B",
        help="Render only samples A to B of each pixel, for `primray merge`; multiples of 2.",
        show_default=False,
    ),
]
Checkpoint = Annotated[
    str | None,
    typer.Option("--checkpoint", metavar="FILE", help="Write checkpoints, from which --resume continues.", show_default=False),
]
CheckpointEvery = Annotated[
    float | None, typer.Option("--checkpoint-every", metavar="S", help="Seconds between checkpoints.", show_default="60")
]
Resume = Annotated[
    str | None,
    typer.Option(
        "--resume", metavar="FILE", help="Continue from a checkpoint, and keep writing it unless --checkpoint names another."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON lines to stdout.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-V", help="Print every diagnostic and prim, and tracebacks of errors.")]


Background = Annotated[
    str | None,
    typer.Option(
        "--background",
        metavar="COLOR|transparent|FILE",
        help="Background: a colour as displayed (#rrggbb, or r,g,b in 0 to 1), transparent, or a picture.",
        show_default=False,
    ),
]
Turntable = Annotated[
    int | None,
    typer.Option("--turntable", metavar="N", help="Render N frames of one orbit around the scene.", show_default=False),
]
FramesPerSecond = Annotated[
    float | None,
    typer.Option("--fps", metavar="N", help="Also write a movie of a --turntable at this frame rate.", show_default=False),
]
Preview = Annotated[
    bool,
    typer.Option(
        "--preview",
        help="Quick look, not for measurements: 16 samples per pixel (or --spp), denoised (unless --no-denoise).",
    ),
]
