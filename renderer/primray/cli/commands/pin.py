"""`primray pin`: renders a picture and writes its lock: hashes of all that its bits depend on, and of the bits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...settings import RenderSettings
from .. import option_values
from ..flags import (
    CONTENTS,
    DIFFUSION,
    FRAMES,
    LIGHTING,
    REFUSAL,
    SIZE,
    SURFACES,
    TEXTURES,
    VIEWPOINT,
    frames_in,
    in_order,
    setting_values,
)

if TYPE_CHECKING:
    from ...pinned.pinning import Pinned


@in_order(
    *("scene", "output", "lock", "sign", *VIEWPOINT, *SIZE, *FRAMES, "spp", "target_error", "error_metric", "time_limit_s"),
    *(
        "denoise",
        "stop_at",
        "mixes",
        "adaptive",
        "max_depth",
        "clamp_indirect",
        "caustics",
        "filter",
        "filter_width",
        "threads",
        "seed",
    ),
    *("rendering_color_space", "aovs", "aov_errors", "deep_tolerance", "deep_samples", *REFUSAL, "max_memory_bytes", *TEXTURES),
    *(*SURFACES, *DIFFUSION, "lens_flaws", *LIGHTING, *CONTENTS, "json", "verbose"),
)
def pin(
    scene: str,
    output: Annotated[
        str | None, typer.Option("--output", "-o", metavar="FILE", help="EXR of the picture.", show_default="none")
    ] = None,
    lock: Annotated[
        str | None, typer.Option("--lock", metavar="FILE", help="Lock file.", show_default="<picture>.lock.json")
    ] = None,
    sign: Annotated[
        str | None,
        typer.Option(
            "--sign",
            metavar="KEY",
            help="Also write NAME.intoto.jsonl, signed by the Ed25519 private key in this PEM file.",
            show_default=False,
        ),
    ] = None,
    json: bool = False,
    verbose: bool = False,
    **given: Any,
) -> None:
    """Render a picture and write its lock, with which `primray verify` proves its bits anywhere."""
    from ...pinned.attestation import attest, check_key
    from ...pinned.pinning import pin as pinned_of
    from ..console import showing

    time_code = option_values.one_frame_of(frames_in(given, scene), "pin")
    settings = RenderSettings(**setting_values(given), time_code=time_code)
    if sign is not None:
        check_key(sign)
    with showing(output or scene, json) as progress:
        made = pinned_of(scene, output, settings, lock=lock, progress=progress)
    signed = None if sign is None else attest(made.file, sign)
    _tell(made, signed, json)


def _tell(made: Pinned, signed: Path | None, as_json: bool) -> None:
    from ..console import print_line

    picture = made.lock.picture
    if as_json:
        facts = {"file": made.lock.file, "pixels_sha256": picture.pixels_sha256, "inputs": len(made.lock.inputs)}
        facts |= {"tiles": len(picture.tiles), "samples": picture.samples}
        print_line({"type": "pin", "lock": str(made.file), "attestation": None if signed is None else str(signed)} | facts)
        return
    width, height = picture.resolution
    print(
        f"{made.file}: {width} x {height} pixels, {picture.samples / (width * height):.4g} samples each, "
        f"of {len(made.lock.inputs)} files, pixels_sha256 {picture.pixels_sha256[:12]}"
    )
    if signed is not None:
        print(f"{signed}: signed")
