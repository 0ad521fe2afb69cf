"""Flags of `primray render` for presentation: background, turntable, preview."""

from __future__ import annotations

from typing import Annotated

import typer

Background = Annotated[
    str | None,
    typer.Option(
        "--background",
        metavar="COLOR|transparent|FILE",
        help="Behind all that is drawn: a colour as displayed (#rrggbb, or r,g,b in 0 to 1), nothing, or a picture.",
        show_default=False,
    ),
]
Turntable = Annotated[
    int | None,
    typer.Option("--turntable", metavar="N", help="N frames from once around what is drawn.", show_default=False),
]
FramesPerSecond = Annotated[
    float | None,
    typer.Option("--fps", metavar="N", help="Of a --turntable's movie; without it, frames alone.", show_default=False),
]
Preview = Annotated[
    bool,
    typer.Option(
        "--preview",
        help="Denoised (unless --no-denoise), of 16 samples a pixel (or --spp), in seconds: to look at, not to measure.",
    ),
]
