"""`primray explain`: what the light of one pixel is made of."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ...errors import SettingsError
from ...settings import RenderSettings
from .. import option_values
from ..flags import CONTENTS, FRAMES, LIGHTING, SIZE, SURFACES, VIEWPOINT, frames_in, in_order, setting_values

OVERLAY_SPP = 16  # samples a pixel, at most, of the picture that paths are drawn over


@in_order(
    *("scene", "pixel", "spp", *VIEWPOINT, *SIZE, *FRAMES),
    *("max_depth", "clamp_indirect", "caustics", "filter", "filter_width", "threads", "seed", *SURFACES, "lens_flaws"),
    *("json", "rendering_color_space", *LIGHTING, *CONTENTS, "verbose"),
)
def explain(
    scene: str,
    pixel: Annotated[
        tuple[int, int],
        typer.Option("--pixel", "-P", metavar="X Y", help="The pixel, from the left and the top.", show_default=False),
    ],
    renders: Annotated[
        int,
        typer.Option("--renders", metavar="N", help="Further renders of the pixel, from which errors come; 0: no errors."),
    ] = 15,
    most: Annotated[int, typer.Option("--most", metavar="N", min=0, help="Parts of each split to print.")] = 8,
    report: Annotated[str | None, typer.Option(metavar="FILE", help="Write all parts as JSON.", show_default=False)] = None,
    edits: Annotated[
        bool, typer.Option("--edits", help="Try edits that would lessen the noise: time gained, change of the picture.")
    ] = False,
    overlay: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Draw the paths that make the noise over the picture, as a PNG.", show_default=False),
    ] = None,
    layer: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Write the paths that make the noise as a USD layer of curves.", show_default=False),
    ] = None,
    json: bool = False,
    verbose: bool = False,
    **given: Any,
) -> None:
    """Say what one pixel's light is made of: by light, by kind of path, by bounce, by the prim that sends it, with errors."""
    from ...diagnostic_messages import print_diagnostics
    from ...explanation.explained import Explainer
    from ...images.image import write_text
    from ...images.output_path import check_folder
    from ...incremental.scene import KeptStage
    from ..console import dumps, print_line

    for path in (report, overlay, layer):
        if path is not None:
            check_folder(Path(path))
    if overlay is not None and Path(overlay).suffix.lower() != ".png":
        raise SettingsError("the paths are drawn over a PNG", where=overlay, code="output-format")
    option_values.check_layer_name(layer)
    time_code = option_values.one_frame_of(frames_in(given, scene), "explain")
    settings = RenderSettings(**setting_values(given), time_code=time_code)
    explainer = Explainer(KeptStage(scene, settings, writes_session=edits))
    found = explainer.explain(*pixel, settings, renders=renders, edits=edits)
    print_diagnostics([one.as_json() for one in explainer.diagnostics], verbose=verbose)
    if report is not None:
        write_text(Path(report), dumps(found.as_json(), indent=2) + "\n")
    if layer is not None:
        found.save_layer(layer, explainer.stage)
    if overlay is not None:
        found.save_overlay(explainer.picture(settings, OVERLAY_SPP), overlay)
    if json:
        print_line(found.as_json())
    else:
        print("\n".join(found.lines(most)))
