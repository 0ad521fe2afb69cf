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
    typer.Option("--camera", "-c", "-cam", metavar="CAMERA", help="Path or name of the camera prim.", show_default=False),
]
AutomaticCamera = Annotated[
    AutoCamera, typer.Option("--auto-camera", help="View of a stage without cameras: three-quarter from above, or usdrecord's.")
]
RenderPassPrim = Annotated[
    str | None,
    typer.Option(
        "--render-pass",
        "--renderPassPrimPath",
        "-rp",
        metavar="PRIM",
        help="Path of the RenderPass to render, or its name in /Render.",
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
        help="Path of the RenderSettings to use, or its name in /Render.",
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
        help="Resolution in pixels, also as WxH; a 0 is computed from the camera's aspect ratio.",
        show_default=False,
    ),
]
ImageWidth = Annotated[
    int | None,
    typer.Option(
        "--imageWidth",
        "-w",
        metavar="W",
        help="Width in pixels; the height follows from the camera's aspect ratio.",
        show_default=False,
    ),
]
ResolutionScale = Annotated[
    float | None,
    typer.Option(
        "--res-scale",
        "-S",
        metavar="PERCENT",
        help="Scale of the resolution, whichever setting it comes from.",
        show_default="100",
    ),
]
Frames = Annotated[
    str | None,
    typer.Option(
        "--frames",
        "--frame",
        "-f",
        metavar="LIST",
        help="Time codes to render: 1, 1:10, 1-10x2, 1:10:2, 1,5 or start:end; inspect and estimate take one.",
        show_default="default time",
    ),
]
FrameCount = Annotated[
    int | None,
    typer.Option(
        "--frame-count", "-n", metavar="N", help="Number of frames, starting at --frame (default 1).", show_default=False
    ),
]
FrameIncrement = Annotated[
    float | None, typer.Option("--frame-inc", "-i", metavar="N", help="Step between frames.", show_default="1")
]
DefaultTime = Annotated[bool, typer.Option("--defaultTime", "-d", help="Render the stage's default time, as without --frames.")]
NoDefaultLight = Annotated[
    bool, typer.Option("--no-default-light", "--disableCameraLight", help="Leave a stage without lights dark.")
]
Studio = Annotated[
    StudioLight,
    typer.Option(
        "--studio-light",
        help="Add a studio light. auto: if the stage has no light at all, and emissive surfaces light less than 35 % of the "
        "visible surfaces; on: in addition to the stage's lights.",
    ),
]
Dome = Annotated[
    str | None,
    typer.Option(
        "--dome", metavar="FILE", help="Lat-long image for a dome light that replaces the stage's.", show_default=False
    ),
]
DomeRotation = Annotated[
    float,
    typer.Option(
        "--dome-rotation",
        metavar="DEGREES",
        help="Rotate --dome, else the stage's domes, about the up axis, counterclockwise seen from above.",
    ),
]
DomeVisible = Annotated[
    OnOff, typer.Option("--dome-visible", help="Whether the camera sees --dome; off also hides the stage's own domes.")
]
GroundBelow = Annotated[
    Ground | None,
    typer.Option("--ground", help="Ground below the scene: a shadow catcher, or a grey plane.", show_default=False),
]
WrapByDefault = Annotated[
    DefaultWrap,
    typer.Option("--default-wrap", help="Wrap mode of textures for which neither stage nor file specifies one."),
]
MaterialContext = Annotated[
    RenderContext,
    typer.Option("--render-context", help="Surface output to use of a material that has both."),
]
NoTranslatedShaders = Annotated[
    bool,
    typer.Option(
        "--no-translated-shaders",
        help="Show displayColor for materials that only have shaders of Arnold, RenderMan or Houdini.",
    ),
]
Purposes = Annotated[
    str | None,
    typer.Option(
        "--purposes",
        "--purpose",
        metavar="LIST",
        help="Purposes to render besides default, such as render,proxy.",
        show_default="the stage's",
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
    typer.Option(
        "--load", metavar="PRIM", help="Load payloads only at and below this prim; may be repeated.", show_default="all"
    ),
]
Mask = Annotated[
    list[str] | None,
    typer.Option(
        "--mask",
        metavar="PRIM",
        help="Populate only this prim, its ancestors and descendants, and the targets of its relationships; may be repeated.",
        show_default=False,
    ),
]
SessionLayer = Annotated[
    str | None,
    typer.Option(
        "--session-layer",
        "--sessionLayer",
        metavar="FILE",
        help="Layer with opinions stronger than the stage's.",
        show_default=False,
    ),
]
DicingRate = Annotated[
    float, typer.Option("--dicing-rate", metavar="PIXELS", help="Longest edge of diced subdivision surfaces, in pixels.")
]
NoMotionBlur = Annotated[
    bool,
    typer.Option("--no-motion-blur", "--disable-motionblur", help="Render without motion blur, whatever the camera's shutter."),
]
Shutter = Annotated[
    tuple[float, float] | None,
    typer.Option(
        "--shutter",
        metavar="OPEN CLOSE",
        help="Shutter times in time codes relative to the frame, overriding the camera's.",
        show_default=False,
    ),
]
Region = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option(
        "--region",
        metavar="LEFT BOTTOM RIGHT TOP",
        help="Render only this part of the picture, in 0 to 1, overriding dataWindowNDC.",
        show_default=False,
    ),
]
MotionError = Annotated[
    float | None,
    typer.Option(
        "--motion-error",
        metavar="PIXELS",
        help="Maximum error of motion paths, in pixels.",
        show_default="the stage's, else 0.02",
    ),
]
LensFlaws = Annotated[
    list[str] | None,
    typer.Option(
        "--lens",
        metavar="NAME=NUMBERS",
        help="Imperfection of the lens: natural-vignetting=1, mechanical-vignetting=DISTANCE,RADIUS, lateral-chromatic=R,G,B "
        "or longitudinal-chromatic=R,G,B; may be repeated.",
        show_default="the camera's",
    ),
]
Dicing = Annotated[
    Complexity | None,
    typer.Option("--complexity", help="Dicing rate of 16, 8, 4 or 2 pixels, instead of --dicing-rate.", show_default=False),
]
Strict = Annotated[bool, typer.Option("--strict", help="Refuse a stage with warnings that affect the picture.")]
FailOn = Annotated[
    list[str] | None,
    typer.Option(
        "--fail-on",
        metavar="CODES",
        help="Refuse a stage with any of these diagnostic codes, separated by commas; `missing` stands for missing files; "
        "may be repeated.",
        show_default=False,
    ),
]
Allow = Annotated[
    list[str] | None,
    typer.Option(
        "--allow",
        metavar="CODES",
        help="Exempt these diagnostic codes from --strict and --fail-on; may be repeated.",
        show_default=False,
    ),
]
RenderingColorSpace = Annotated[
    str | None,
    typer.Option(
        "--rendering-color-space",
        metavar="NAME",
        help="Linear RGB space for rendering, such as lin_ap1_scene.",
        show_default="the stage's, else lin_rec709_scene",
    ),
]
