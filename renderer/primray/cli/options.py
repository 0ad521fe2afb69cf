"""Options that commands share; what their values mean is in option_values.py."""

from __future__ import annotations

from typing import Annotated

import typer

from ..settings import Filter, Metric

Scene = Annotated[str, typer.Argument(metavar="SCENE", help="The USD stage: usda, usdc, usd or usdz.", show_default=False)]
Camera = Annotated[
    str | None,
    typer.Option("--camera", "-c", "-cam", metavar="CAMERA", help="Prim path or name of a camera.", show_default=False),
]
RenderSettingsPrim = Annotated[
    str | None,
    typer.Option(
        "--render-settings",
        "--renderSettingsPrimPath",
        "-rs",
        metavar="PRIM",
        help="Path of the RenderSettings to follow.",
        show_default="the stage's",
    ),
]
Products = Annotated[
    list[str] | None,
    typer.Option(
        "--product",
        metavar="PRIM",
        help="Path or name of a RenderProduct, written under its own name; may be repeated.",
        show_default="the first",
    ),
]
AllProducts = Annotated[bool, typer.Option("--all-products", help="Every product of the RenderSettings, under its own name.")]
OutputDir = Annotated[
    str | None, typer.Option(metavar="DIR", help="Where products are written.", show_default="the current folder")
]
Resolution = Annotated[
    tuple[int, int] | None,
    typer.Option("--res", "-r", metavar="W H", help="Pixels; one of them 0: by the camera's aspect.", show_default=False),
]
ImageWidth = Annotated[
    int | None,
    typer.Option("--imageWidth", "-w", metavar="W", help="Pixels; the height by the camera's aspect.", show_default=False),
]
Samples = Annotated[
    int | None,
    typer.Option(
        "--spp",
        "--pixel-samples",
        "-p",
        metavar="N",
        help="Samples per pixel; a cap where an error or a time is asked for.",
        show_default="64, or no cap",
    ),
]
TargetError = Annotated[
    float | None,
    typer.Option("--target-error", metavar="E", help="Stop when the error is estimated to be no larger.", show_default=False),
]
ErrorMetric = Annotated[
    Metric,
    typer.Option(
        "--error-metric",
        help="relmse: mean of (I-R)^2/(R^2+0.01); rmse; display: rmse after the view, in 8-bit steps.",
    ),
]
Adaptive = Annotated[
    bool | None,
    typer.Option("--adaptive/--no-adaptive", help="More samples where the error is.", show_default="with --target-error"),
]
Frame = Annotated[
    str | None, typer.Option("--frame", "--frames", "-f", metavar="N", help="Time code.", show_default="default time")
]
MaxDepth = Annotated[
    int | None,
    typer.Option(metavar="N", help="Surface scatterings, 1 = direct light only.", show_default="no limit"),
]
PixelFilter = Annotated[Filter, typer.Option("--filter", help="Pixel filter.")]
FilterWidth = Annotated[float | None, typer.Option(metavar="W", help="Full width in pixels.", show_default="box 1, else 3")]
Threads = Annotated[int | None, typer.Option("--threads", "-j", metavar="N", help="Threads.", show_default="all cores")]
Aovs = Annotated[
    list[str] | None,
    typer.Option(
        "--aov",
        metavar="NAME",
        help="Outputs beside the picture, as parts of an EXR: names by commas, all, or none; may be repeated.",
        show_default="the stage's",
    ),
]
Seed = Annotated[int, typer.Option(metavar="N", help="Of the random numbers.")]
NoDefaultLight = Annotated[bool, typer.Option("--no-default-light", help="Leave a stage without lights dark.")]
Purposes = Annotated[
    str | None, typer.Option("--purposes", metavar="LIST", help="Such as default,render,proxy.", show_default="the stage's")
]
Variants = Annotated[
    list[str] | None,
    typer.Option("--variant", metavar="PRIM:SET=NAME", help="Choose a variant; may be repeated.", show_default=False),
]
NoPayloads = Annotated[bool, typer.Option("--no-payloads", help="Load no payloads.")]
Load = Annotated[
    list[str] | None,
    typer.Option("--load", metavar="PRIM", help="Load payloads only here and below; may be repeated.", show_default="all"),
]
Mask = Annotated[
    list[str] | None,
    typer.Option(
        "--mask",
        metavar="PRIM",
        help="Populate only these prims, what is above and below them and what they refer to; may be repeated.",
        show_default=False,
    ),
]
SessionLayer = Annotated[
    str | None,
    typer.Option("--session-layer", "--sessionLayer", metavar="FILE", help="Opinions over the stage's.", show_default=False),
]
DicingRate = Annotated[
    float, typer.Option("--dicing-rate", metavar="PIXELS", help="Longest edges of subdivision surfaces on the picture.")
]
View = Annotated[
    str | None, typer.Option("--view", metavar="NAME", help="OCIO view of PNG and JPEG.", show_default="the display's default")
]
Display = Annotated[
    str | None,
    typer.Option("--display", metavar="NAME", help="OCIO display of PNG and JPEG.", show_default="the configuration's default"),
]
Look = Annotated[
    str | None,
    typer.Option(
        "--look", metavar="NAME", help="OCIO look of PNG and JPEG, in place of the view's.", show_default="the view's"
    ),
]
RenderingColorSpace = Annotated[
    str | None,
    typer.Option(
        "--rendering-color-space",
        metavar="NAME",
        help="Linear RGB space that light is computed in, such as lin_ap1_scene.",
        show_default="the stage's, else lin_rec709_scene",
    ),
]
Exposure = Annotated[float, typer.Option("--exposure", metavar="STOPS", help="Of PNG and JPEG.")]
Report = Annotated[str | None, typer.Option("--report", metavar="FILE", help="Write the report as JSON.", show_default=False)]
Checkpoint = Annotated[
    str | None,
    typer.Option("--checkpoint", metavar="FILE", help="Write what is needed to go on from there.", show_default=False),
]
Json = Annotated[bool, typer.Option("--json", help="JSON lines on stdout.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-V", help="Every diagnostic and prim; tracebacks of errors.")]
