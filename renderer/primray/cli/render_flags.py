"""Flags for sampling and stopping, shared by all commands that render or submit renders."""

from __future__ import annotations

from copy import copy
from typing import Annotated, Any, get_args

import typer
from typer.models import OptionInfo

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
        help="Samples per pixel; with a target error or time limit, the maximum on average.",
        show_default="the stage's, else 64, or no cap",
    ),
]
TargetError = Annotated[
    float | None,
    typer.Option("--target-error", metavar="E", help="Stop when the estimated error is at most E.", show_default=False),
]
ErrorMetric = Annotated[
    Metric | None,
    typer.Option(
        "--error-metric",
        "--metric",
        help="relmse: mean of (I-R)^2/(R^2+0.01); rmse; display: rmse of the displayed picture, in 8-bit steps.",
        show_default="the stage's, else relmse",
    ),
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit",
        "--max-seconds",
        metavar="S",
        help="Stop each frame after this many seconds of sampling (not counting set-up).",
        show_default=False,
    ),
]
Adaptive = Annotated[
    bool | None,
    typer.Option(
        "--adaptive/--no-adaptive", help="Take more samples where the error is large.", show_default="with --target-error"
    ),
]
MaxDepth = Annotated[
    int | None,
    typer.Option(
        "--max-depth",
        metavar="N",
        help="Maximum number of surface scattering events; 1: direct light only.",
        show_default="the stage's, else no limit",
    ),
]
ClampIndirect = Annotated[
    float | None,
    typer.Option(
        "--clamp-indirect",
        metavar="V",
        help="Clamp indirect light (two or more scattering events) of each sample to V; the report states the bias.",
        show_default="no clamp",
    ),
]
Caustics = Annotated[
    OnOff,
    typer.Option(
        "--caustics",
        help="off: leave out light that reaches diffuse surfaces via specular ones; the report states the bias.",
    ),
]
PixelFilter = Annotated[Filter | None, typer.Option("--filter", help="Pixel filter.", show_default="the stage's, else box")]
FilterWidth = Annotated[
    float | None,
    typer.Option("--filter-width", metavar="W", help="Full width of the filter in pixels.", show_default="box 1, else 3"),
]
Threads = Annotated[
    int | None,
    typer.Option("--threads", "-j", metavar="N", help="Number of threads; -1: all cores but one.", show_default="all cores"),
]
Seed = Annotated[int, typer.Option("--seed", "--lock-random", metavar="N", help="Seed of the random numbers.")]
MaxMemory = Annotated[
    str | None,
    typer.Option(
        "--max-memory",
        metavar="SIZE",
        help="Memory limit of the process, beyond which the render fails: 4G, 500M; auto: that of the container or machine.",
        show_default="no limit",
    ),
]
Ray = Annotated[
    str | None,
    typer.Option(
        "--ray",
        metavar="ADDRESS",
        help="Split the samples over the nodes of a Ray cluster: HOST:PORT, or auto on one of its nodes.",
        show_default=False,
    ),
]
PilotSeconds = Annotated[float, typer.Option("--pilot", metavar="S", help="Seconds of sampling for the pilot render.")]


def with_own_default(flag: Any) -> OptionInfo:
    """Return the option of a flag, showing the command's own default in the help."""
    [option] = get_args(flag)[1:]
    own: OptionInfo = copy(option)
    own.show_default = True
    return own
