"""`primray view`: shows a stage in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from primray.cli import option_values, output_flags, render_flags, stage_flags
from primray.cli.option_values import OnOff
from primray.cli.render_flags import with_own_default
from primray.settings import AutoCamera, DefaultWrap, RenderContext, RenderSettings, StudioLight

from ..cli.connection import need_extra
from ..cli.exits import problems_as_errors

SPP = 1024  # a picture refines up to this many samples per pixel


def view(
    scene: stage_flags.Scene,
    camera: stage_flags.Camera = None,
    auto_camera: stage_flags.AutomaticCamera = AutoCamera.THREE_QUARTER,
    render_settings: stage_flags.RenderSettingsPrim = None,
    render_pass: stage_flags.RenderPassPrim = None,
    res: stage_flags.Resolution = None,
    image_width: stage_flags.ImageWidth = None,
    res_scale: stage_flags.ResolutionScale = None,
    frames: stage_flags.Frames = None,
    spp: Annotated[int, with_own_default(render_flags.Samples)] = SPP,
    max_depth: render_flags.MaxDepth = None,
    threads: render_flags.Threads = None,
    max_memory: render_flags.MaxMemory = None,
    display: output_flags.Display = None,
    view: output_flags.View = None,
    look: output_flags.Look = None,
    exposure: output_flags.Exposure = None,
    no_default_light: stage_flags.NoDefaultLight = False,
    studio_light: stage_flags.Studio = StudioLight.AUTO,
    dome: stage_flags.Dome = None,
    dome_rotation: stage_flags.DomeRotation = 0.0,
    dome_visible: stage_flags.DomeVisible = OnOff.ON,
    ground: stage_flags.GroundBelow = None,
    default_wrap: stage_flags.WrapByDefault = DefaultWrap.BLACK,
    render_context: stage_flags.MaterialContext = RenderContext.MTLX,
    no_translated_shaders: stage_flags.NoTranslatedShaders = False,
    purposes: stage_flags.Purposes = None,
    variants: stage_flags.Variants = None,
    no_payloads: stage_flags.NoPayloads = False,
    load: stage_flags.Load = None,
    mask: stage_flags.Mask = None,
    session_layer: stage_flags.SessionLayer = None,
    port: Annotated[int, typer.Option(metavar="N", help="Port; 0: any free one.", min=0, max=65535)] = 0,
    no_open: Annotated[bool, typer.Option("--no-open", help="Print the page's address without opening a browser.")] = False,
) -> None:
    """Show a stage in a browser: it is rendered again as files, variants and the camera change. Ctrl-C ends it."""
    need_extra("view")
    settings = RenderSettings(
        camera=option_values.camera_of(camera),
        auto_camera=auto_camera,
        render_settings=option_values.render_settings_of(render_settings),
        render_pass=option_values.render_settings_of(render_pass),
        resolution=option_values.resolution_of(res, image_width),
        resolution_scale=option_values.scale_of(res_scale),
        time_code=option_values.one_frame_of(frames, "view"),
        spp=spp,
        max_depth=max_depth,
        threads=option_values.threads_of(threads),
        max_memory_bytes=option_values.bytes_of(max_memory),
        default_light=not no_default_light,
        studio_light=studio_light,
        dome=dome,
        dome_rotation=dome_rotation,
        dome_visible=dome_visible is OnOff.ON,
        ground=ground,
        default_wrap=default_wrap,
        render_context=render_context,
        translated_shaders=not no_translated_shaders,
        purposes=option_values.purposes_of(purposes),
        variants=tuple(variants or ()),
        load=option_values.load_of(no_payloads, load),
        mask=option_values.mask_of(mask),
        session_layer=session_layer,
        aovs=(),
    )
    from primray.color.ocio import check_look, check_view
    from primray.live.viewed_scene import ViewedScene
    from primray.live.viewer import Looks

    from .server import serve

    check_view(view, display)
    check_look(look)
    looks = Looks(view, display, look, option_values.exposure_of(exposure) or 0.0)
    viewed = ViewedScene(scene, settings)
    viewed.open()  # reports a stage that cannot be opened here, not on a page that nobody has opened yet
    with problems_as_errors():
        serve(viewed, settings.most_samples, looks, Path(scene).name, port, opens=not no_open)
