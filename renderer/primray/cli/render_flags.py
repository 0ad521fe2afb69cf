"""Flags for sampling and stopping, shared by all commands that render or submit renders."""

from __future__ import annotations

from typing import Annotated

import typer

from ..settings import Filter, Metric
from .option_values import OnOff

Samples = Annotated[
    int | None,
    typer.Option(
        "--spp",
        "--pixel-samples",
        "-p",
        "--max-samples",
        metavar="N",
        help="Samples per pixel; with an error or a time asked for, the most on average.",
        show_default="the stage's, else 64, or no cap",
    ),
]
TargetError = Annotated[
    float | None,
    typer.Option("--target-error", metavar="E", help="Stop when the error is estimated to be no larger.", show_default=False),
]
ErrorMetric = Annotated[
    Metric | None,
    typer.Option(
        "--error-metric",
        "--metric",
        help="relmse: mean of (I-R)^2/(R^2+0.01); rmse; display: rmse after the view, in 8-bit steps.",
        show_default="the stage's, else relmse",
    ),
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        "--max-seconds",
        metavar="S",
        help="Stop a frame after so many seconds of sampling (set-up comes before).",
        show_default=False,
    ),
]
Adaptive = Annotated[
    bool | None,
    typer.Option("--adaptive/--no-adaptive", help="More samples where the error is.", show_default="with --target-error"),
]
MaxDepth = Annotated[
    int | None,
    typer.Option(
        "--max-depth",
        metavar="N",
        help="Surface scatterings, 1 = direct light only.",
        show_default="the stage's, else no limit",
    ),
]
ClampIndirect = Annotated[
    float | None,
    typer.Option(
        "--clamp-indirect",
        metavar="V",
        help="A stated bias: a sample's light of two scatterings and more has V at most; the report says what that takes away.",
        show_default="no clamp",
    ),
]
Caustics = Annotated[
    OnOff,
    typer.Option(
        "--caustics",
        help="off, a stated bias: light that reaches diffuse surfaces over specular ones is left out, and reported.",
    ),
]
PixelFilter = Annotated[Filter | None, typer.Option("--filter", help="Pixel filter.", show_default="the stage's, else box")]
FilterWidth = Annotated[
    float | None, typer.Option("--filter-width", metavar="W", help="Full width in pixels.", show_default="box 1, else 3")
]
Threads = Annotated[
    int | None, typer.Option("--threads", "-j", metavar="N", help="Threads; -1: all cores but one.", show_default="all cores")
]
Seed = Annotated[int, typer.Option("--seed", "--lock-random", metavar="N", help="Of the random numbers.")]
MaxMemory = Annotated[
    str | None,
    typer.Option(
        "--max-memory",
        metavar="SIZE",
        help="The process holds no more, or the render fails: 4G, 500M; auto: what the container or machine has.",
        show_default="no limit",
    ),
]
Ray = Annotated[
    str | None,
    typer.Option(
        "--ray",
        metavar="ADDRESS",
        help="Render the samples in parts on the nodes of the Ray cluster there: HOST:PORT, or auto on one of its nodes.",
        show_default=False,
    ),
]
PilotSeconds = Annotated[float, typer.Option("--pilot", metavar="S", help="Seconds of sampling to judge by.")]
