"""Flags of `primray render` for presentation: background, turntable, preview."""

from __future__ import annotations

from typing import Annotated

import typer

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
