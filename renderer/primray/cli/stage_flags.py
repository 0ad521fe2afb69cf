"""Flags for the stage: camera, frames, composition and lighting, shared by all commands that open one.

Their values are converted in option_values.py.
"""

from __future__ import annotations

from typing import Annotated

import typer

from ..settings import AutoCamera, DefaultWrap, Ground, RenderContext, StudioLight
from .option_values import Complexity, OnOff

Scene = Annotated[str, typer.Argument(metavar="SCENE", help="The USD stage: usda, usdc, usd or usdz.", show_default=False)]
Camera = Annotated[
    str | None,
    typer.Option("--camera", "-c", "-cam", metavar="CAMERA", help="Prim path or name of a camera.", show_default=False),
]
AutomaticCamera = Annotated[
    AutoCamera, typer.Option("--auto-camera", help="The view of a stage without cameras: a quarter from above, or usdrecord's.")
]
RenderPassPrim = Annotated[
    str | None,
    typer.Option(
        "--render-pass",
        "--renderPassPrimPath",
        "-rp",
        metavar="PRIM",
        help="Path of the RenderPass to render, or name in /Render.",
        show_default="none",
    ),
]
RenderSettingsPrim = Annotated[
    str | None,
    typer.Option(
        "--render-settings",
        "--renderSettingsPrimPath",
        "-rs",
        "--settings",
        "-s",
        metavar="PRIM",
        help="Path of the RenderSettings to follow, or name in /Render.",
        show_default="the stage's",
    ),
]
Resolution = Annotated[
    tuple[int, int] | None,
    typer.Option(
        "--res",
        "-r",
        "--resolution",
        metavar="W H",
        help="Pixels, also as WxH; one of them 0: by the camera's aspect.",
        show_default=False,
    ),
]
ImageWidth = Annotated[
    int | None,
    typer.Option("--imageWidth", "-w", metavar="W", help="Pixels; the height by the camera's aspect.", show_default=False),
]
ResolutionScale = Annotated[
    float | None,
    typer.Option("--res-scale", "-S", metavar="PERCENT", help="Of the resolution, whoever chose it.", show_default="100"),
]
Frames = Annotated[
    str | None,
    typer.Option(
        "--frames",
        "--frame",
        "-f",
        metavar="LIST",
        help="Time codes: 1, 1:10, 1-10x2, 1:10:2, 1,5 or start:end; inspect and estimate take one.",
        show_default="default time",
    ),
]
FrameCount = Annotated[
    int | None,
    typer.Option("--frame-count", "-n", metavar="N", help="So many frames from --frame (1) on.", show_default=False),
]
FrameIncrement = Annotated[
    float | None, typer.Option("--frame-inc", "-i", metavar="N", help="From a frame to the next.", show_default="1")
]
DefaultTime = Annotated[
    bool, typer.Option("--defaultTime", "-d", help="The stage's default time, as where no frames are asked for.")
]
NoDefaultLight = Annotated[
    bool, typer.Option("--no-default-light", "--disableCameraLight", help="Leave a stage without lights dark.")
]
Studio = Annotated[
    StudioLight,
    typer.Option(
        "--studio-light",
        help="auto: where the stage has no light, not even a weak one, and what glows lights less than 35 % of what is seen; "
        "on: beside its lights.",
    ),
]
Dome = Annotated[
    str | None,
    typer.Option(
        "--dome", metavar="FILE", help="A lat-long image as light, in place of the stage's domes.", show_default=False
    ),
]
DomeRotation = Annotated[
    float,
    typer.Option(
        "--dome-rotation",
        metavar="DEGREES",
        help="Turns --dome, else the stage's domes, about the up axis, counterclockwise from above.",
    ),
]
DomeVisible = Annotated[
    OnOff, typer.Option("--dome-visible", help="Whether the camera sees --dome; off: nor the stage's own domes.")
]
GroundBelow = Annotated[
    Ground | None,
    typer.Option("--ground", help="Below all that is drawn: only its shadow, or a grey plane.", show_default=False),
]
WrapByDefault = Annotated[
    DefaultWrap,
    typer.Option("--default-wrap", help="Outside of textures whose wrap neither the stage nor the file names."),
]
MaterialContext = Annotated[
    RenderContext,
    typer.Option("--render-context", help="Of a material that has both, the surface output that counts."),
]
NoTranslatedShaders = Annotated[
    bool,
    typer.Option(
        "--no-translated-shaders",
        help="Materials that carry only Arnold's, RenderMan's or Houdini's shaders show displayColor.",
    ),
]
Purposes = Annotated[
    str | None,
    typer.Option(
        "--purposes", "--purpose", metavar="LIST", help="Such as render,proxy, beside default.", show_default="the stage's"
    ),
]
Variants = Annotated[
    list[str] | None,
    typer.Option(
        "--variant", "--variants", metavar="PRIM:SET=NAME", help="Choose a variant; may be repeated.", show_default=False
    ),
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
NoMotionBlur = Annotated[
    bool, typer.Option("--no-motion-blur", "--disable-motionblur", help="A still of the frame, whatever the camera's shutter.")
]
Shutter = Annotated[
    tuple[float, float] | None,
    typer.Option(
        "--shutter", metavar="OPEN CLOSE", help="Time codes from the frame on: in place of the camera's.", show_default=False
    ),
]
Region = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option(
        "--region",
        metavar="LEFT BOTTOM RIGHT TOP",
        help="Only this part of the picture, in 0 to 1: in place of dataWindowNDC.",
        show_default=False,
    ),
]
MotionError = Annotated[
    float | None,
    typer.Option(
        "--motion-error",
        metavar="PIXELS",
        help="Pixels that the path of anything may be off.",
        show_default="the stage's, else 0.02",
    ),
]
LensFlaws = Annotated[
    list[str] | None,
    typer.Option(
        "--lens",
        metavar="NAME=NUMBERS",
        help="Of the camera's lens: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS, lateral-chromatic=R,G,B or "
        "longitudinal-chromatic=R,G,B; may be repeated.",
        show_default="the camera's",
    ),
]
Dicing = Annotated[
    Complexity | None,
    typer.Option("--complexity", help="In place of --dicing-rate: 16, 8, 4 or 2 pixels.", show_default=False),
]
Strict = Annotated[bool, typer.Option("--strict", help="Refuse a stage with warnings about the picture.")]
FailOn = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-on",
        metavar="CODES",
        help="Refuse a stage with diagnostics of these codes, by commas; `missing`: files that are not there. May be repeated.",
        show_default=False,
    ),
]
Allow = Annotated[
    list[str] | None,
    typer.Option(
        "--allow", metavar="CODES", help="Let these pass --strict and --fail-on; may be repeated.", show_default=False
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
