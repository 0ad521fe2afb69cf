"""`primray view`: shows a stage in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from primray.cli import option_values
from primray.cli.flags import CONTENTS, LIGHTING, SIZE, TEXTURES, VIEWPOINT, in_order, setting_values
from primray.settings import RenderSettings

from ..cli.connection import need_extra
from ..cli.exits import problems_as_errors

SPP = 1024  # a picture refines up to this many samples per pixel


@in_order(
    *("scene", *VIEWPOINT, *SIZE, "frames", "spp", "max_depth", "threads", "max_memory_bytes", *TEXTURES),
    *("display", "view", "look", "exposure", *LIGHTING, *CONTENTS),
)
def view(
    scene: str,
    frames: str | None = None,
    spp: int = SPP,
    display: str | None = None,
    view: str | None = None,
    look: str | None = None,
    exposure: str | None = None,
    port: Annotated[int, typer.Option(metavar="N", help="Port; 0: any free one.", min=0, max=65535)] = 0,
    no_open: Annotated[bool, typer.Option("--no-open", help="Print the page's address without opening a browser.")] = False,
    **given: Any,
) -> None:
    """Show a stage in a browser: it is rendered again as files, variants and the camera change. Ctrl-C ends it."""
    need_extra("view")
    values = setting_values({**given, "spp": spp})
    settings = RenderSettings(**values, time_code=option_values.one_frame_of(frames, "view"), aovs=())
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
